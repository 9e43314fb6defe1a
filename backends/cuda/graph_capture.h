// A CUDA graph that is captured from launches on a stream, with conditional nodes.
#pragma once

#include <cuda_runtime.h>

#include <utility>
#include <vector>

#include "backends/cuda/device_memory.h"

#if CUDART_VERSION < 12080
#error "Graphs that choose one of several bodies need CUDA 12.8 or newer"
#endif

namespace ambilux {

class GraphCapture {
public:
    explicit GraphCapture(cudaStream_t stream) : stream_(stream) {}

    /// Where launches go: inside of a conditional node another stream than outside.
    cudaStream_t stream() const { return stream_; }
    bool active() const { return active_; }

    /// What `launches()` launches, ready to run.
    template <class Launches>
    cudaGraphExec_t capture(Launches launches) {
        cuda_check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "begin of graph capture");
        active_ = true;
        launches();
        active_ = false;
        cudaGraph_t graph = nullptr;
        cuda_check(cudaStreamEndCapture(stream_, &graph), "graph capture");
        cudaGraphExec_t exec = nullptr;
        const cudaError_t made = cudaGraphInstantiate(&exec, graph, 0);
        cudaGraphDestroy(graph);
        cuda_check(made, "graph instantiation");
        return exec;
    }

    cudaGraphConditionalHandle make_condition() const {
        cudaGraphConditionalHandle handle{};
        cuda_check(cudaGraphConditionalHandleCreate(&handle, captured().first, 0, cudaGraphCondAssignDefault),
                   "conditional handle");
        return handle;
    }

    /// A conditional node of `bodies` graphs, of which body(k) launches the k-th.
    template <class Body>
    void conditional(cudaGraphConditionalNodeType type, cudaGraphConditionalHandle handle, uint32_t bodies, Body body) {
        const auto [graph, dependencies] = captured();
        cudaGraphNodeParams params = {};
        params.type = cudaGraphNodeTypeConditional;
        params.conditional.handle = handle;
        params.conditional.type = type;
        params.conditional.size = bodies;
        cudaGraphNode_t node = nullptr;
#if CUDART_VERSION >= 13000
        cuda_check(cudaGraphAddNode(&node, graph, dependencies.data(), nullptr, dependencies.size(), &params),
                   "conditional node");
        cuda_check(cudaStreamUpdateCaptureDependencies(stream_, &node, nullptr, 1, cudaStreamSetCaptureDependencies),
                   "conditional node");
#else
        cuda_check(cudaGraphAddNode(&node, graph, dependencies.data(), dependencies.size(), &params),
                   "conditional node");
        cuda_check(cudaStreamUpdateCaptureDependencies(stream_, &node, 1, cudaStreamSetCaptureDependencies),
                   "conditional node");
#endif

        const cudaStream_t outer = stream_;
        cuda_check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream");
        for (uint32_t k = 0; k < bodies; ++k) {
            cuda_check(cudaStreamBeginCaptureToGraph(stream_, params.conditional.phGraph_out[k], nullptr, nullptr, 0,
                                                     cudaStreamCaptureModeThreadLocal),
                       "begin of conditional capture");
            body(k);
            cuda_check(cudaStreamEndCapture(stream_, nullptr), "conditional capture");
        }
        cuda_check(cudaStreamDestroy(stream_), "stream");
        stream_ = outer;
    }

private:
    /// The graph that the stream is captured into, and the nodes that the next one depends on.
    std::pair<cudaGraph_t, std::vector<cudaGraphNode_t>> captured() const {
        cudaStreamCaptureStatus status;
        cudaGraph_t graph = nullptr;
        const cudaGraphNode_t* nodes = nullptr;
        size_t count = 0;
#if CUDART_VERSION >= 13000
        cuda_check(cudaStreamGetCaptureInfo(stream_, &status, nullptr, &graph, &nodes, nullptr, &count),
                   "graph capture");
#else
        cuda_check(cudaStreamGetCaptureInfo_v2(stream_, &status, nullptr, &graph, &nodes, &count), "graph capture");
#endif
        return {graph, {nodes, nodes + count}};
    }

    cudaStream_t stream_;
    bool active_ = false;
};

}  // namespace ambilux
