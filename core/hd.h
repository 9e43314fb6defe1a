// Marks functions that run on the host and on a CUDA device alike.
#pragma once

#if defined(__CUDACC__)
#define AMBILUX_HD __host__ __device__ inline
/// A few operations on numbers: never a call on the host, whose compiler stops to inline where kernels grow (a call of
/// `dot` costs more than what it does).
#define AMBILUX_HD_SMALL AMBILUX_HD
/// Not copied into its callers on a device. For what is long and called in several places: threads of a warp that run
/// through different code wait for instructions more than for anything else once kernels exceed the instruction caches.
/// Structs are taken and returned by value: what a reference leads to lies in memory, not in registers, and with it all
/// of the struct that it is a part of (docs/performance.md).
#define AMBILUX_HD_APART __host__ __device__ __noinline__ inline
/// One copy on the host. For what several stages of one name do: compilers contract sums of products differently in
/// every copy, and images should not depend on which of them ran.
#define AMBILUX_HD_ONCE __host__ __device__ inline
#else
#define AMBILUX_HD inline
#define AMBILUX_HD_SMALL inline __attribute__((always_inline))
#define AMBILUX_HD_APART inline
#define AMBILUX_HD_ONCE inline __attribute__((noinline))
#endif
