// Captures the stages of one wave into a CUDA graph. Loops over depths are conditional nodes, sizes of queues are read on the device: between the launch of a
// graph and its end the host does nothing.
#pragma once

#include <cuda_runtime.h>

#include "backends/cuda/device_memory.h"
#include "backends/cuda/trace_kernels.cuh"
#include "queues/queue.h"
#include "stages/stage.h"
#include "stages/wave.h"

#if CUDART_VERSION < 12040
#error "Conditional graph nodes need CUDA 12.4 or newer"
#endif

namespace ambilux {

constexpr uint32_t kStageBlock = 128;

namespace detail {

/// Nanoseconds of the device's clock.
__device__ inline uint64_t device_nanoseconds() {
    uint64_t ns;
    asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(ns));
    return ns;
}

template <class Stage>
__global__ void __launch_bounds__(kStageBlock) launch_fixed(const __grid_constant__ Stage stage, uint32_t n) {
    for (uint32_t i = blockIdx.x * kStageBlock + threadIdx.x; i < n; i += gridDim.x * kStageBlock) stage(i);
}

template <class Stage>
__global__ void __launch_bounds__(kStageBlock) launch_queue(const __grid_constant__ Stage stage, const QueueCounter* counter) {
    const uint32_t n = counter->size();
    for (uint32_t i = blockIdx.x * kStageBlock + threadIdx.x; i < n; i += gridDim.x * kStageBlock) stage(i);
}

/// Rays by persistent threads. Camera rays stay together; all others are in no order.
template <class Stage>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm) launch_trace(const __grid_constant__ Stage stage, QueueCounter* counter, const WaveState* state) {
    const uint32_t n = counter->size();
    const bool coherent = state->depth == 1 && !Stage::kAnyHit;
    const TraceTuning tuning = {coherent ? kCoherentTuning.refill_below : kIncoherentTuning.refill_below,
                                coherent ? kCoherentTuning.primitives_at : kIncoherentTuning.primitives_at};
    const auto fetch = [&](uint32_t i, Ray& ray) { return stage.fetch(i, ray); };
    if constexpr (Stage::kAnyHit)
        trace_any_persistent<Stage::kFeatures>(stage.scene, stage.tracer, fetch, [&](uint32_t i, bool blocked) { stage.finish(i, blocked); }, &n, &counter->next, tuning);
    else
        trace_closest_persistent<Stage::kFeatures>(stage.scene, stage.tracer, fetch, [&](uint32_t i, const Hit& hit) { stage.finish(i, hit); }, &n, &counter->next, tuning);
}

/// After a stage: its record, and its queue emptied. The time since the last such kernel is the stage's.
__global__ inline void finish_stage(StageRecord* record, QueueCounter* counter, uint32_t n, const WaveState* state, uint64_t* clock) {
    const uint64_t now = device_nanoseconds();
    record->add(counter ? counter->size() : n, state->depth, now - *clock);
    if (counter) counter->finish();
    *clock = now;
}

__global__ inline void start_clock(uint64_t* clock) { *clock = device_nanoseconds(); }

__global__ inline void set_depth(WaveState* state, uint32_t depth) { state->depth = depth; }

__global__ inline void next_depth(WaveState* state, const QueueCounter* counter, cudaGraphConditionalHandle again) {
    ++state->depth;
    cudaGraphSetConditional(again, counter->count > 0);
}

__global__ inline void set_wave(WaveState* state, WaveState value) { *state = value; }

}  // namespace detail

/// Executor of a schedule (integrators/path/schedule.h) whose result is a graph.
class CudaGraphBuilder {
public:
    /// `clock`: one value on the device.
    CudaGraphBuilder(cudaStream_t stream, WaveState* state, StageRecord* records, uint64_t* clock) : stream_(stream), state_(state), records_(records), clock_(clock) {
        int device = 0;
        cuda_check(cudaGetDevice(&device), "device");
        cuda_check(cudaDeviceGetAttribute(&multiprocessors_, cudaDevAttrMultiProcessorCount, device), "multiprocessors");
    }

    /// Captures what `schedule(*this)` launches.
    template <class Schedule>
    cudaGraphExec_t build(Schedule schedule) {
        cuda_check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "begin of graph capture");
        detail::start_clock<<<1, 1, 0, stream_>>>(clock_);
        schedule(*this);
        cudaGraph_t graph = nullptr;
        cuda_check(cudaStreamEndCapture(stream_, &graph), "graph capture");
        cudaGraphExec_t exec = nullptr;
        const cudaError_t made = cudaGraphInstantiate(&exec, graph, 0);
        cudaGraphDestroy(graph);
        cuda_check(made, "graph instantiation");
        return exec;
    }

    template <class Stage>
    void run(StageId id, const Stage& stage, uint32_t n) {
        detail::launch_fixed<<<blocks(detail::launch_fixed<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, n);
        finish(id, nullptr, n);
    }
    template <class Stage, class Item>
    void run(StageId id, const Stage& stage, const Queue<Item>& queue) {
        detail::launch_queue<<<blocks(detail::launch_queue<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, queue.counter);
        finish(id, queue.counter, 0);
    }
    template <class Stage, class Item>
    void trace(StageId id, const Stage& stage, const Queue<Item>& queue) {
        detail::launch_trace<<<blocks(detail::launch_trace<Stage>, kTraceBlock), kTraceBlock, 0, stream_>>>(stage, queue.counter, state_);
        finish(id, queue.counter, 0);
    }

    template <class Item, class Body>
    void repeat_while(const Queue<Item>& queue, Body body) {
        detail::set_depth<<<1, 1, 0, stream_>>>(state_, 1);
        cudaStreamCaptureStatus status;
        cudaGraph_t graph = nullptr;
        const cudaGraphNode_t* dependencies = nullptr;
        size_t count = 0;
#if CUDART_VERSION >= 13000
        cuda_check(cudaStreamGetCaptureInfo(stream_, &status, nullptr, &graph, &dependencies, nullptr, &count), "graph capture");
#else
        cuda_check(cudaStreamGetCaptureInfo_v2(stream_, &status, nullptr, &graph, &dependencies, &count), "graph capture");
#endif
        cuda_check(cudaGraphConditionalHandleCreate(&again_, graph, 1, cudaGraphCondAssignDefault), "conditional handle");
        cudaGraphNodeParams params = {};
        params.type = cudaGraphNodeTypeConditional;
        params.conditional.handle = again_;
        params.conditional.type = cudaGraphCondTypeWhile;
        params.conditional.size = 1;
        cudaGraphNode_t node = nullptr;
#if CUDART_VERSION >= 13000
        cuda_check(cudaGraphAddNode(&node, graph, dependencies, nullptr, count, &params), "conditional node");
        cuda_check(cudaStreamUpdateCaptureDependencies(stream_, &node, nullptr, 1, cudaStreamSetCaptureDependencies), "conditional node");
#else
        cuda_check(cudaGraphAddNode(&node, graph, dependencies, count, &params), "conditional node");
        cuda_check(cudaStreamUpdateCaptureDependencies(stream_, &node, 1, cudaStreamSetCaptureDependencies), "conditional node");
#endif

        const cudaStream_t outer = stream_;
        cuda_check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream");
        cuda_check(cudaStreamBeginCaptureToGraph(stream_, params.conditional.phGraph_out[0], nullptr, nullptr, 0, cudaStreamCaptureModeThreadLocal), "begin of loop capture");
        loop_counter_ = queue.counter;
        body();
        cuda_check(cudaStreamEndCapture(stream_, nullptr), "loop capture");
        cuda_check(cudaStreamDestroy(stream_), "stream");
        stream_ = outer;
        detail::set_depth<<<1, 1, 0, stream_>>>(state_, 0);
    }
    void next_depth() { detail::next_depth<<<1, 1, 0, stream_>>>(state_, loop_counter_, again_); }

private:
    void finish(StageId id, QueueCounter* counter, uint32_t n) {
        cuda_check(cudaGetLastError(), kStageNames[uint32_t(id)]);
        detail::finish_stage<<<1, 1, 0, stream_>>>(records_ + uint32_t(id), counter, n, state_, clock_);
    }
    /// As many blocks as can be resident.
    template <class Kernel>
    uint32_t blocks(Kernel* kernel, uint32_t threads) const {
        int per_multiprocessor = 0;
        cuda_check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per_multiprocessor, kernel, int(threads), 0), "occupancy");
        return uint32_t(multiprocessors_ * (per_multiprocessor > 0 ? per_multiprocessor : 1));
    }

    cudaStream_t stream_;
    WaveState* state_;
    StageRecord* records_;
    uint64_t* clock_;
    int multiprocessors_ = 0;
    cudaGraphConditionalHandle again_{};
    const QueueCounter* loop_counter_ = nullptr;
};

}  // namespace ambilux
