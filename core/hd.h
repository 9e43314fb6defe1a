// Marks functions that run on the host and on a CUDA device alike.
#pragma once

#if defined(__CUDACC__)
#define AMBILUX_HD __host__ __device__ inline
/// Not copied into its callers on a device. For what is long and called in several places: threads of a warp that run through different code wait for instructions more than for anything
/// else once kernels exceed the instruction caches (docs/performance.md).
#define AMBILUX_HD_APART __host__ __device__ __noinline__ inline
#else
#define AMBILUX_HD inline
#define AMBILUX_HD_APART inline
#endif
