// Faults of a CUDA device: the linker leads the functions of CUDA's runtime that our code calls through this file
// (--wrap), which lets the n-th of them fail, and counts what is made and not destroyed. For one file of a test.
#pragma once

#include <cuda_runtime.h>

#include <atomic>
#include <utility>

namespace ambilux::test {

enum class Fault {
    memory,  ///< what needs memory fails, from the n-th such call on, as when it is used up
    lost,    ///< the device is lost: all fail from the n-th call on, and what they should have done is not done
};

/// What is injected, and what is alive.
struct CudaFaults {
    static constexpr long kNever = -1;

    std::atomic<long> left{kNever};  ///< calls until one fails
    std::atomic<Fault> fault{Fault::memory};
    std::atomic<bool> begun{false};
    std::atomic<long> alive{0};  ///< buffers, streams, graphs, events

    void inject(Fault what, long n) {
        begun = false;
        fault = what;
        left = n;
    }
    void stop() { left = kNever; }

    /// Of a call now; `allocates`: it needs memory. What it must return.
    cudaError_t next(bool allocates) {
        const bool lost = fault == Fault::lost;
        if (!lost && !allocates) return cudaSuccess;
        for (long n = left; n != kNever;) {
            if (n == 0) {
                begun = true;
                return lost ? cudaErrorLaunchFailure : cudaErrorMemoryAllocation;
            }
            if (left.compare_exchange_weak(n, n - 1)) break;
        }
        return cudaSuccess;
    }
    /// Only once a call has failed: an error of what is destroyed before would be nobody's.
    bool is_lost() const { return fault == Fault::lost && begun && left == 0; }
};
inline CudaFaults cuda_faults;

/// The error that cudaGetLastError() tells next, of this thread.
inline thread_local cudaError_t last_injected = cudaSuccess;

inline cudaError_t injected(bool allocates) {
    const cudaError_t error = cuda_faults.next(allocates);
    if (error != cudaSuccess) last_injected = error;
    return error;
}
/// Of a call that makes, or destroys, an object.
inline cudaError_t counted(cudaError_t error, long objects) {
    if (error == cudaSuccess) cuda_faults.alive += objects;
    return error;
}
/// Of a call that destroys, which is done in any case: a lost device frees all that it had.
inline cudaError_t destroyed(cudaError_t error, bool was_there) {
    counted(error, was_there ? -1 : 0);
    return cuda_faults.is_lost() ? last_injected = cudaErrorLaunchFailure : error;
}

}  // namespace ambilux::test

#define AMBILUX_WRAPPED(name, parameters) \
    cudaError_t __real_##name parameters; \
    cudaError_t __wrap_##name parameters
/// A call that makes nothing.
#define AMBILUX_FAILS(name, allocates, parameters, arguments)          \
    AMBILUX_WRAPPED(name, parameters) {                                \
        const cudaError_t error = ambilux::test::injected(allocates);  \
        return error != cudaSuccess ? error : __real_##name arguments; \
    }
#define AMBILUX_MAKES(name, parameters, arguments)                                                \
    AMBILUX_WRAPPED(name, parameters) {                                                           \
        const cudaError_t error = ambilux::test::injected(true);                                  \
        return error != cudaSuccess ? error : ambilux::test::counted(__real_##name arguments, 1); \
    }
#define AMBILUX_DESTROYS(name, Type) \
    AMBILUX_WRAPPED(name, (Type object)) { return ambilux::test::destroyed(__real_##name(object), object != nullptr); }

// What our code calls; the list after "// wraps:" of the test must be the same.
extern "C" {
AMBILUX_MAKES(cudaMalloc, (void** p, size_t n), (p, n))
AMBILUX_MAKES(cudaMallocManaged, (void** p, size_t n, unsigned int f), (p, n, f))
AMBILUX_MAKES(cudaHostAlloc, (void** p, size_t n, unsigned int f), (p, n, f))
AMBILUX_MAKES(cudaStreamCreateWithFlags, (cudaStream_t * s, unsigned int f), (s, f))
AMBILUX_MAKES(cudaGraphInstantiate, (cudaGraphExec_t * e, cudaGraph_t g, unsigned long long f), (e, g, f))
AMBILUX_DESTROYS(cudaFree, void*)
AMBILUX_DESTROYS(cudaFreeHost, void*)
AMBILUX_DESTROYS(cudaStreamDestroy, cudaStream_t)
AMBILUX_DESTROYS(cudaGraphDestroy, cudaGraph_t)
AMBILUX_DESTROYS(cudaGraphExecDestroy, cudaGraphExec_t)

AMBILUX_FAILS(cudaGraphAddNode, true,
              (cudaGraphNode_t * n, cudaGraph_t g, const cudaGraphNode_t* d, const cudaGraphEdgeData* e, size_t c,
               cudaGraphNodeParams* p),
              (n, g, d, e, c, p))
AMBILUX_FAILS(cudaGraphConditionalHandleCreate, true,
              (cudaGraphConditionalHandle * h, cudaGraph_t g, unsigned int v, unsigned int f), (h, g, v, f))
AMBILUX_FAILS(cudaStreamBeginCapture, false, (cudaStream_t s, cudaStreamCaptureMode m), (s, m))
AMBILUX_FAILS(cudaStreamBeginCaptureToGraph, false,
              (cudaStream_t s, cudaGraph_t g, const cudaGraphNode_t* d, const cudaGraphEdgeData* e, size_t n,
               cudaStreamCaptureMode m),
              (s, g, d, e, n, m))
AMBILUX_FAILS(cudaLaunchKernel, false, (const void* f, dim3 g, dim3 b, void** a, size_t n, cudaStream_t s),
              (f, g, b, a, n, s))
#if CUDART_VERSION >= 13000
AMBILUX_FAILS(__cudaLaunchKernel, false, (cudaKernel_t f, dim3 g, dim3 b, void** a, size_t n, cudaStream_t s),
              (f, g, b, a, n, s))
#endif
AMBILUX_FAILS(cudaGraphLaunch, false, (cudaGraphExec_t g, cudaStream_t s), (g, s))
AMBILUX_FAILS(cudaMemcpy, false, (void* to, const void* from, size_t n, cudaMemcpyKind k), (to, from, n, k))
AMBILUX_FAILS(cudaMemcpyAsync, false, (void* to, const void* from, size_t n, cudaMemcpyKind k, cudaStream_t s),
              (to, from, n, k, s))
AMBILUX_FAILS(cudaMemset, false, (void* to, int v, size_t n), (to, v, n))
AMBILUX_FAILS(cudaMemsetAsync, false, (void* to, int v, size_t n, cudaStream_t s), (to, v, n, s))
AMBILUX_FAILS(cudaStreamSynchronize, false, (cudaStream_t s), (s))
AMBILUX_FAILS(cudaDeviceSynchronize, false, (), ())
AMBILUX_FAILS(cudaMemGetInfo, false, (size_t* f, size_t* t), (f, t))

// A capture ends in any case.
AMBILUX_WRAPPED(cudaStreamEndCapture, (cudaStream_t s, cudaGraph_t* g)) {
    const cudaError_t error = ambilux::test::injected(false), ended = __real_cudaStreamEndCapture(s, g);
    if (g && *g) ++ambilux::test::cuda_faults.alive;
    return error != cudaSuccess ? error : ended;
}
AMBILUX_WRAPPED(cudaGetLastError, ()) {
    const cudaError_t error = std::exchange(ambilux::test::last_injected, cudaSuccess);
    const cudaError_t real = __real_cudaGetLastError();
    return error != cudaSuccess ? error : real;
}
}
