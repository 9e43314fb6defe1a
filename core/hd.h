// Marks functions that run on the host and on a CUDA device alike.
#pragma once

#if defined(__CUDACC__)
#define AMBILUX_HD __host__ __device__ inline
#else
#define AMBILUX_HD inline
#endif
