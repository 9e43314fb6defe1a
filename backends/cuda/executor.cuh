// Runs the stages of one wave on a CUDA device. They are captured into a graph whose loop over depths is a conditional
// node; sizes of queues are read on the device: between the launch of a graph and its end the host does nothing. The
// same can be launched kernel by kernel, for profilers and sanitizers.
#pragma once

#include <cuda_runtime.h>

#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "backends/cuda/device_memory.h"
#include "backends/cuda/order.h"
#include "backends/cuda/stage_kernels.cuh"
#include "queues/queue.h"
#include "stages/order_keys.h"
#include "stages/stage.h"
#include "stages/tail.h"

#if CUDART_VERSION < 12080
#error "Graphs that choose one of several bodies need CUDA 12.8 or newer"
#endif

namespace ambilux {

/// Executor of a schedule (integrators/path/schedule.h). `kPairs`: kernels are made for binary BVHs too.
template <bool kPairs>
class BasicCudaExecutor {
public:
    static constexpr bool kTails = true;        ///< has run_tail
    static constexpr bool kTracesPairs = true;  ///< runs ConnectAndOcclude

    /// `traced`: features that rays have to know of, the scene's or more. `clock`: one value on the device.
    BasicCudaExecutor(cudaStream_t stream, const Features& traced, WaveState* state, StageRecord* records,
                      uint64_t* clock, const SceneView& scene, const OrderMemory& order)
        : stream_(stream), traced_(traced), state_(state), records_(records), clock_(clock), scene_(scene),
          order_(order) {
        int device = 0;
        cuda_check(cudaGetDevice(&device), "device");
        cuda_check(cudaDeviceGetAttribute(&multiprocessors_, cudaDevAttrMultiProcessorCount, device),
                   "multiprocessors");
        if (order.policy.ordering != Ordering::none) list_places(order, stream);
    }

    /// Captures what `schedule(*this)` launches.
    template <class Schedule>
    cudaGraphExec_t capture(Schedule schedule) {
        cuda_check(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), "begin of graph capture");
        capturing_ = true;
        launch(schedule);
        capturing_ = false;
        cudaGraph_t graph = nullptr;
        cuda_check(cudaStreamEndCapture(stream_, &graph), "graph capture");
        cudaGraphExec_t exec = nullptr;
        const cudaError_t made = cudaGraphInstantiate(&exec, graph, 0);
        cudaGraphDestroy(graph);
        cuda_check(made, "graph instantiation");
        return exec;
    }

    /// Launches kernel by kernel; the host reads the size of a queue wherever the schedule loops.
    template <class Schedule>
    void launch(Schedule schedule) {
        detail::start_clock<<<1, 1, 0, stream_>>>(clock_);
        schedule(*this);
    }

    template <class Stage>
    void run_slots(StageId id, const Stage& stage, uint32_t slots, uint32_t samples = 0) {
        detail::launch_slots<<<blocks(detail::launch_slots<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(
            stage, slots, samples, state_);
        finish(id, nullptr, nullptr, slots, samples);
    }
    template <class Stage>
    void run_paths(StageId id, const Stage& stage, uint32_t slots) {
        detail::launch_paths<<<blocks(detail::launch_paths<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(
            stage, slots, state_);
        finish(id, nullptr, nullptr, slots);
    }
    template <class Stage, class Item>
    void run(StageId id, const Stage& stage, const Queue<Item>& queue) {
        const detail::Items items = prepare<MaterialOrder>(stage, queue);
        if constexpr (Chained<Stage>)
            detail::launch_chains<<<blocks(detail::launch_chains<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(
                stage, items);
        else if constexpr (detail::Gathered<Stage>)
            detail::launch_gathered<<<blocks(detail::launch_gathered<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(
                stage, items);
        else
            detail::launch_items<<<blocks(detail::launch_items<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage,
                                                                                                                items);
        finish(id, queue.counter);
    }
    /// Several depths of the walks of `hits`, which must be appended.
    template <class Shade, class Extend, class Item>
    void run_tail(StageId id, const Shade& shade, const Extend& extend, const Queue<Item>& hits) {
        using Kernel = Tail<Shade, Extend>;
        detail::launch_tail<<<blocks(detail::launch_tail<Kernel>, kStageBlock), kStageBlock, 0, stream_>>>(
            Kernel{shade, extend}, hits.counter);
        finish(id, hits.counter);
    }
    /// Rays go through `pairs` instead of the tracer of their stage.
    void use(const PairTracer& pairs)
        requires kPairs
    {
        pairs_ = pairs;
    }

    template <class Stage, class Item>
    void trace(StageId id, const Stage& stage, const Queue<Item>& queue) {
        launch_traces(stage, queue);
        finish(id, queue.counter);
    }
    template <class Stage, class Item, class Out>
    void extend(StageId id, const Stage& stage, const Queue<Item>& rays, const Queue<Out>& hits) {
        launch_traces(stage, rays);
        finish(id, rays.counter, hits.flags ? nullptr : hits.counter);
    }
    template <class Stage, class Item, class Out>
    void extend_coherent(StageId id, const Stage& stage, const Queue<Item>& rays, const Queue<Out>& hits) {
        const detail::Items items = prepare<void>(stage, rays);  // in order as they are
        with_tracer(stage, [&](auto set, const auto& tracer) {
            const auto kernel = detail::launch_coherent<decltype(set), Stage, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream_>>>(stage, tracer, items);
        });
        finish(id, rays.counter, hits.flags ? nullptr : hits.counter);
    }
    /// generate and the extend that follows, of depth 1; the time is extend's. Items must be appended.
    template <class Generate, class Extend>
    void generate_and_extend(const Generate& generate, const Extend& extend, uint32_t slots) {
        finish(StageId::generate, nullptr, nullptr, slots);
        set_depth(1);
        with_tracer(extend, [&](auto set, const auto& tracer) {
            const auto kernel =
                detail::launch_camera_rays<decltype(set), Generate, Extend, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream_>>>(generate, extend, tracer, slots, state_);
        });
        finish(StageId::extend, extend.rays.counter, extend.hits.counter);
    }
    /// From the next record on.
    void set_depth(uint32_t depth) { depth_ = {true, depth}; }
    void next_depth(uint32_t depths = 1) { depth_.value += depths; }

    template <class A, class B>
    void settle(const A& a, const B& b) {
        detail::settle_queues<<<1, 1, 0, stream_>>>(state_, a.counter, b.counter);
    }
    template <class Item>
    void clear(const Queue<Item>& queue) {
        detail::clear_queue<<<1, 1, 0, stream_>>>(queue.counter);
    }
    void finish_wave() { detail::finish_wave<<<1, 1, 0, stream_>>>(state_); }

    /// While there are `least` items.
    template <class Item, class Body>
    void repeat_while(const Queue<Item>& queue, Body body, uint32_t least = 1) {
        const auto counted_body = [&] {
            counted_ = queue.counter;
            body();
        };
        const auto count = [&] { this->count(queue); };
        if (capturing_) return capture_loop(queue.counter, least, count, counted_body);
        for (count(); size_of(queue.counter) >= least; count()) counted_body();
    }

private:
    template <class Stage, class Item>
    void launch_traces(const Stage& stage, const Queue<Item>& rays) {
        const detail::Items items = prepare<MortonOrder>(stage, rays);
        with_tracer(stage, [&](auto set, const auto& tracer) {
            const auto kernel = detail::launch_trace<decltype(set), Stage, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream_>>>(stage, tracer, items);
        });
    }
    /// f(FeatureSet, tracer) with the set that tracing needs. Kernels are made only for sets that the stage's own
    /// features cover.
    template <class Stage, class Function>
    void with_tracer(const Stage& stage, Function f) const {
        with_traversal_features(traced_, [&](auto set) {
            if constexpr (Stage::kFeatures.covers(decltype(set)::value)) {
                if constexpr (kPairs)
                    if (pairs_) return f(set, *pairs_);
                f(set, stage.tracer);
            }
        });
    }

    /// What a launch over `queue` goes through, sorted if it is to be. A loop has counted its queue already when its
    /// body begins with that queue.
    template <class Order, class Stage, class Item>
    detail::Items prepare(const Stage& stage, const Queue<Item>& queue) {
        const bool counted = counted_ == queue.counter;
        counted_ = nullptr;
        if (!counted) count(queue);
        const bool selected = queue.flags && order_.policy.compaction == Compaction::select;
        detail::Items items = {
            queue.counter, selected ? order_.list[0] : nullptr, queue.flags, queue.capacity, nullptr, nullptr, 0};
        if constexpr (Ordered<Order, Item>) {
            if (order_.policy.ordering == Order::kOrdering && queue.capacity > 0) {
                const uint32_t bits = Order::bits(scene_);
                const bool whole = queue.flags && !items.list;
                const detail::SortSwitch choice = {
                    capturing_ && !whole ? make_condition() : cudaGraphConditionalHandle{}, capturing_ && !whole};
                const uint32_t last = (1u << bits) - 1;
                if (queue.keys)
                    detail::fill_keys<<<blocks(detail::fill_keys, kStageBlock), kStageBlock, 0, stream_>>>(
                        queue.keys, items, uint16_t(last), choice);
                else
                    detail::make_keys<Order, Item>
                        <<<blocks(detail::make_keys<Order, Item>, kStageBlock), kStageBlock, 0, stream_>>>(
                            scene_, queue, items, last, order_.keys[0], choice);
                if (whole)
                    sort_places(order_, queue.keys, queue.capacity, bits, stream_);
                else
                    sort_as_many(queue, bits, choice);
                (whole ? items.list : items.sorted) = order_.list[1];
                if constexpr (detail::SkipsMisses<Stage>) {
                    if (queue.keys && !whole && stage.skips_misses())
                        items.keys = reinterpret_cast<const uint16_t*>(order_.keys[1]),
                        items.end = uint16_t(MaterialOrder::of(scene_, kNone));
                }
            }
        }
        return items;
    }
    /// Sorts no more places than hold the items. A graph has a sort for each of several sizes, since its launches are
    /// laid down before it is known.
    template <class Item>
    void sort_as_many(const Queue<Item>& queue, uint32_t bits, const detail::SortSwitch& sorts) {
        const auto sort = [&](uint32_t k) {
            if (k < detail::kSortSizes) sort_places(order_, queue.keys, queue.capacity >> k, bits, stream_);
        };
        if (capturing_)
            capture_conditional(cudaGraphCondTypeSwitch, sorts.handle, detail::kSortSizes, sort);
        else
            sort(detail::sort_choice(queue.capacity, size_of(queue.counter)));
    }
    /// Has the counter of a queue of fixed places tell its size; compaction select makes the list too.
    template <class Item>
    void count(const Queue<Item>& queue) {
        if (!queue.flags || queue.capacity == 0) return;
        if (order_.policy.compaction == Compaction::select)
            select_places(order_, queue.flags, queue.capacity, &queue.counter->count, stream_);
        else
            detail::count_items<<<blocks(detail::count_items, kStageBlock), kStageBlock, 0, stream_>>>(
                queue.flags, queue.capacity, &queue.counter->count);
    }

    template <class Count, class Body>
    void capture_loop(const QueueCounter* counter, uint32_t least, Count count, Body body) {
        const cudaGraphConditionalHandle again = make_condition();
        // Set before every entry, since a loop inside of a loop is entered more than once.
        count();
        detail::repeat_while_any<<<1, 1, 0, stream_>>>(counter, least, again);
        capture_conditional(cudaGraphCondTypeWhile, again, 1, [&](uint32_t) {
            body();
            count();
            detail::repeat_while_any<<<1, 1, 0, stream_>>>(counter, least, again);
        });
    }
    cudaGraphConditionalHandle make_condition() const {
        cudaGraphConditionalHandle handle{};
        cuda_check(cudaGraphConditionalHandleCreate(&handle, captured().first, 0, cudaGraphCondAssignDefault),
                   "conditional handle");
        return handle;
    }
    /// `bodies` graphs, of which body(k) captures the k-th.
    template <class Body>
    void capture_conditional(cudaGraphConditionalNodeType type, cudaGraphConditionalHandle handle, uint32_t bodies,
                             Body body) {
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

    uint32_t size_of(const QueueCounter* counter) const {
        QueueCounter c;
        cuda_check(cudaMemcpyAsync(&c, counter, sizeof(c), cudaMemcpyDeviceToHost, stream_), "queue size");
        cuda_check(cudaStreamSynchronize(stream_), "queue size");
        return c.size();
    }
    void finish(StageId id, QueueCounter* counter, QueueCounter* out = nullptr, uint32_t slots = 0,
                uint32_t samples = 0) {
        cuda_check(cudaGetLastError(), kStageNames[uint32_t(id)]);
        detail::finish_stage<<<1, 1, 0, stream_>>>(records_ + uint32_t(id), counter, out, slots, samples, depth_,
                                                   state_, clock_);
        depth_ = {};
    }
    /// As many blocks as can be resident.
    template <class Kernel>
    uint32_t blocks(Kernel* kernel, uint32_t threads) const {
        int per_multiprocessor = 0;
        cuda_check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per_multiprocessor, kernel, int(threads), 0),
                   "occupancy");
        return uint32_t(multiprocessors_ * (per_multiprocessor > 0 ? per_multiprocessor : 1));
    }

    cudaStream_t stream_;
    Features traced_;
    std::optional<PairTracer> pairs_;
    WaveState* state_;
    StageRecord* records_;
    uint64_t* clock_;
    SceneView scene_;
    OrderMemory order_;
    const QueueCounter* counted_ = nullptr;  ///< of the queue whose count and list are known before the next launch
    int multiprocessors_ = 0;
    bool capturing_ = false;
    detail::DepthChange depth_{};
};

using CudaExecutor = BasicCudaExecutor<false>;

}  // namespace ambilux
