// Streams and graphs of CUDA that destroy themselves.
#pragma once

#include <memory>
#include <type_traits>

#include "backends/cuda/device_memory.h"

namespace ambilux {

struct DestroyHandle {
    void operator()(cudaStream_t stream) const { cudaStreamDestroy(stream); }
    void operator()(cudaGraph_t graph) const { cudaGraphDestroy(graph); }
    void operator()(cudaGraphExec_t graph) const { cudaGraphExecDestroy(graph); }
};
template <class Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, DestroyHandle>;

/// A stream that does not wait for the default one.
inline Owned<cudaStream_t> make_stream() {
    cudaStream_t stream = nullptr;
    cuda_check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "stream");
    return Owned<cudaStream_t>(stream);
}

}  // namespace ambilux
