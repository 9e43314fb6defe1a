// A CUDA graph that is captured from launches on a stream, with conditional nodes.
#pragma once

#include <cuda_runtime.h>

#include <utility>
#include <vector>

#include "backends/cuda/handles.h"

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
    Owned<cudaGraphExec_t> capture(Launches launches) {
        cuda_check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "begin of graph capture");
        active_ = true;
        Owned<cudaGraph_t> graph;
        cudaError_t ended = cudaSuccess;
        with_end(launches, [&] {
            cudaGraph_t made = nullptr;
            ended = cudaStreamEndCapture(stream_, &made);
            graph.reset(made);
            active_ = false;
        });
        cuda_check(ended, "graph capture");
        cudaGraphExec_t exec = nullptr;
        cuda_check(cudaGraphInstantiate(&exec, graph.get(), 0), "graph instantiation");
        return Owned<cudaGraphExec_t>(exec);
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
        const Owned<cudaStream_t> inner = make_stream();
        stream_ = inner.get();
        with_end(
            [&] {
                for (uint32_t k = 0; k < bodies; ++k) capture_into(params.conditional.phGraph_out[k], [&] { body(k); });
            },
            [&] { stream_ = outer; });
    }

private:
    template <class Launches>
    void capture_into(cudaGraph_t graph, Launches launches) {
        cuda_check(cudaStreamBeginCaptureToGraph(stream_, graph, nullptr, nullptr, 0, cudaStreamCaptureModeThreadLocal),
                   "begin of conditional capture");
        cudaError_t ended = cudaSuccess;
        with_end(launches, [&] { ended = cudaStreamEndCapture(stream_, nullptr); });
        cuda_check(ended, "conditional capture");
    }
    /// Calls `end` also where `launches` throws: a thread that captures cannot free memory.
    template <class Launches, class End>
    static void with_end(Launches launches, End end) {
        try {
            launches();
        } catch (...) {
            end();
            cudaGetLastError();  // of what was cut short
            throw;
        }
        end();
    }
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
