// Runs the stages of one wave on a CUDA device (integrators/integrator.h says what an executor has). They are captured
// into a graph whose loop over depths is a conditional node; sizes of queues are read on the device: between the launch
// of a graph and its end the host does nothing. The same can be launched kernel by kernel, for profilers and
// sanitizers.
#pragma once

#include <cuda_runtime.h>

#include <optional>
#include <type_traits>

#include "backends/cuda/device_memory.h"
#include "backends/cuda/device_optix.h"
#include "backends/cuda/graph_capture.h"
#include "backends/cuda/handed_kernels.cuh"
#include "backends/cuda/order.h"
#include "backends/cuda/primitives.h"
#include "backends/cuda/ray_kernels.cuh"
#include "backends/cuda/record_kernels.cuh"
#include "backends/cuda/stage_kernels.cuh"
#include "backends/optix.h"

namespace ambilux {

/// `kPairs`: kernels are made for binary BVHs too.
template <bool kPairs>
class CudaExecutor {
public:
    static constexpr bool kHost = false;

    /// `traced`: features that rays have to know of, the scene's or more. `clock`: one value on the device.
    CudaExecutor(cudaStream_t stream, const Features& traced, WaveState* state, uint64_t* clock, const SceneView& scene,
                 const OrderMemory& order)
        : graph_(stream), traced_(traced), state_(state), clock_(clock), scene_(scene), order_(order) {
        int device = 0;
        cuda_check(cudaGetDevice(&device), "device");
        cuda_check(cudaDeviceGetAttribute(&multiprocessors_, cudaDevAttrMultiProcessorCount, device),
                   "multiprocessors");
        if (order.policy.ordering != Ordering::none) list_places(order, stream);
    }
    /// Rays go through `pairs` instead of the tracer of their stage.
    void use(const PairTracer& pairs)
        requires kPairs
    {
        pairs_ = pairs;
    }
    /// Rays are handed over to launches of `optix`, which has taken `handed`.
    void use(const DeviceOptix& optix, const HandedRays& handed) {
        optix_ = &optix;
        handed_ = handed;
    }

    /// Captures what `schedule(*this)` launches.
    template <class Schedule>
    Owned<cudaGraphExec_t> capture(Schedule schedule) {
        return graph_.capture([&] { launch(schedule); });
    }
    /// Launches kernel by kernel; the host reads the size of a queue wherever the schedule loops.
    template <class Schedule>
    void launch(Schedule schedule) {
        detail::start_clock<<<1, 1, 0, stream()>>>(clock_);
        schedule(*this);
        cuda_check(cudaGetLastError(), "wave");  // of launches that are not looked at one by one
    }

    template <class Stage>
    void run_slots(const Stage& stage, uint32_t slots, uint32_t samples = 0) {
        const auto kernel = detail::launch_slots<Stage>;
        kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(stage, slots, samples, state_);
        finish(stage, nullptr, nullptr, slots, samples);
    }
    template <class Stage>
    void run_paths(const Stage& stage, uint32_t slots) {
        const auto kernel = detail::launch_paths<Stage>;
        kernel<<<blocks(kernel, kPathBlock), kPathBlock, 0, stream()>>>(stage, slots, state_);
        finish(stage, nullptr, nullptr, slots);
    }
    template <class Stage>
    void run(const Stage& stage) {
        const detail::Items items = prepare<MaterialOrder>(stage);
        const auto launch = [&](auto kernel) {
            kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(stage, items);
        };
        if constexpr (ConnectionLoop<Stage>)
            launch(detail::launch_loops<Stage>);
        else if constexpr (LaunchTraits<Stage>::kGathers)
            launch(detail::launch_gathered<Stage>);
        else
            launch(detail::launch_items<Stage>);
        finish(stage, items.counter);
    }
    /// Several bounces of the subpaths of hits, which must be appended.
    template <class VertexStage, class Extend>
    void run(const MultiBounce<VertexStage, Extend>& stage) {
        const auto kernel = detail::launch_bounces<MultiBounce<VertexStage, Extend>>;
        QueueCounter* const counter = stage.items().counter;
        kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(stage, counter);
        finish(stage, counter);
    }
    template <class Stage>
    void trace(const Stage& stage) {
        launch_traces(stage);
        finish(stage, stage.items().counter);
    }
    template <class Stage>
    void extend(const Stage& stage) {
        launch_traces(stage);
        finish_extend(stage);
    }
    template <class Stage>
    void extend_coherent(const Stage& stage) {
        const detail::Items items = prepare<void>(stage);  // in order as they are
        if (hands_over(stage, items)) return finish_extend(stage);
        with_tracer(stage, [&](auto set, const auto& tracer) {
            const auto kernel = detail::launch_coherent<decltype(set), Stage, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream()>>>(stage, tracer, items);
        });
        finish_extend(stage);
    }
    /// generate and the extend that follows, of depth 1; the time is extend's. Items must be appended.
    template <class Generate, class Extend>
    void generate_and_extend(const Generate& generate, const Extend& extend, uint32_t slots) {
        if constexpr (kOptixBuilt) {
            if (optix_) {
                run_slots(generate, slots);
                set_depth(1);
                return extend_coherent(extend);
            }
        }
        finish(generate, nullptr, nullptr, slots);
        set_depth(1);
        with_tracer(extend, [&](auto set, const auto& tracer) {
            const auto kernel =
                detail::launch_camera_rays<decltype(set), Generate, Extend, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream()>>>(generate, extend, tracer, slots, state_);
        });
        finish_extend(extend);
    }
    /// From the next record on.
    void set_depth(uint32_t depth) { depth_ = {true, depth}; }
    void next_depth(uint32_t depths) { depth_.value += depths; }

    /// Over items that stay.
    template <class Stage, class Item>
    void for_each(const Stage& stage, const Queue<Item>& queue) {
        const auto kernel = detail::launch_over<Stage>;
        kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(stage, queue.counter, state_);
        finish_over(stage, queue.counter);
    }
    template <class Stage>
    void for_each(const Stage& stage, uint32_t n) {
        run_slots(stage, n, 1);
    }
    /// Has all waves' queue hold what is in that of this wave (stage.items()): stage(i, place) puts item i at `place`.
    /// If there is no room, the wave fails, and the queues `others` are emptied as well.
    template <class Stage, class... Item>
    void append(const Stage& stage, const Queue<Item>&... others) {
        may_fail_ = true;
        QueueCounter* const mine = stage.items().counter;
        detail::reserve<<<1, 1, 0, stream()>>>(state_, mine, stage.target());
        (detail::clear_if_failed<<<1, 1, 0, stream()>>>(state_, others.counter), ...);
        const auto kernel = detail::launch_append<Stage>;
        kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(stage, mine, state_);
        finish_over(stage, mine);
    }
    /// Of as many pairs as `queue` has items, by the lowest `bits` bits; of fewer than `least` none. Their time is that
    /// of the stage that follows.
    template <class Key, class Item>
    void sort_pairs(const SortMemory<Key>& m, const Queue<Item>& queue, uint32_t bits, StageRecord*,
                    uint32_t least = 0) {
        const bool switched = graph_.active();
        const detail::SortSwitch sorts = {switched ? graph_.make_condition() : cudaGraphConditionalHandle{}, switched};
        const auto kernel = detail::pad_keys<Key>;
        const Key last = Key(bits < 8 * sizeof(Key) ? (Key(1) << bits) - 1 : ~Key(0));
        kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(m.keys[0], queue.counter, m.capacity, last,
                                                                          least, sorts);
        if (!switched) {
            const uint32_t n = size_of(queue.counter);
            if (n >= least) sort_pairs_on_device(m, n, bits, stream());
            return;
        }
        graph_.conditional(cudaGraphCondTypeSwitch, sorts.handle, detail::kSortSizes,
                           [&](uint32_t k) { sort_pairs_on_device(m, m.capacity >> k, bits, stream()); });
    }

    // ---- between phases ----

    /// The host waits for it.
    template <class Item>
    uint32_t count(const Queue<Item>& queue) const {
        return size_of(queue.counter);
    }
    template <class Key>
    void sort_pairs(const SortMemory<Key>& m, uint32_t n, uint32_t bits, StageRecord*) {
        sort_pairs_on_device(m, n, bits, stream());
    }
    /// Exclusive sums; `out` may be `in`.
    void scan(const ScanMemory& m, const uint32_t* in, uint32_t* out, uint32_t n, StageRecord*) {
        scan_on_device(m, in, out, n, stream());
    }

    /// True if what was launched since may have failed for want of room.
    bool may_fail() const { return may_fail_; }
    void expect_no_failure() { may_fail_ = false; }

    template <class A, class B>
    void fail_on_overflow(const Queue<A>& a, const Queue<B>& b) {
        may_fail_ = true;
        detail::fail_on_overflow<<<1, 1, 0, stream()>>>(state_, a.counter, b.counter);
    }
    template <class Item>
    void clear(const Queue<Item>& queue) {
        detail::clear_queue<<<1, 1, 0, stream()>>>(queue.counter);
    }
    void store(uint32_t* place, uint32_t value) { detail::store<<<1, 1, 0, stream()>>>(place, value); }
    void finish_wave() { detail::finish_wave<<<1, 1, 0, stream()>>>(state_); }

    /// While there are `least` items.
    template <class Item, class Body>
    void repeat_while(const Queue<Item>& queue, Body body, uint32_t least = 1) {
        const auto counted_body = [&] {
            counted_ = queue.counter;
            body();
        };
        if (graph_.active()) return capture_loop(queue, least, counted_body);
        for (count_places(queue); size_of(queue.counter) >= least; count_places(queue)) counted_body();
    }

private:
    cudaStream_t stream() const { return graph_.stream(); }

    template <class Stage>
    void launch_traces(const Stage& stage) {
        const detail::Items items = prepare<MortonOrder>(stage);
        if (hands_over(stage, items)) return;
        with_tracer(stage, [&](auto set, const auto& tracer) {
            const auto kernel = detail::launch_trace<decltype(set), Stage, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream()>>>(stage, tracer, items);
        });
    }
    /// Of items that go to OptiX; false if they do not. As many runs as the whole queue takes: how many items it holds
    /// is known on the device, and runs without any end at once.
    template <class Stage>
    bool hands_over([[maybe_unused]] const Stage& stage, [[maybe_unused]] const detail::Items& items) {
        if constexpr (kOptixBuilt) {
            if (!optix_) return false;
            const uint32_t grid = (handed_.capacity - 1) / detail::kHandBlock + 1;
            for (uint64_t first = 0; first < items.capacity; first += handed_.capacity) {
                detail::hand_over<<<grid, detail::kHandBlock, 0, stream()>>>(stage, items, handed_, uint32_t(first));
                cuda_check(cudaGetLastError(), Stage::kName);
                optix_->trace(Stage::kAnyHit, stream());
                detail::take_back<<<grid, detail::kHandBlock, 0, stream()>>>(stage, items, handed_, uint32_t(first));
            }
            return true;
        }
        return false;
    }
    /// f(FeatureSet, tracer) with the set that tracing needs.
    template <class Stage, class Function>
    void with_tracer(const Stage& stage, Function f) const {
        with_traversal_features<Stage::kFeatures>(traced_, [&](auto set) {
            if constexpr (kPairs)
                if (pairs_) return f(set, *pairs_);
            f(set, stage.tracer);
        });
    }

    /// What a launch over the items of `stage` goes through, sorted if it is to be. A loop has counted its queue
    /// already when its body begins with that queue.
    template <class Order, class Stage>
    detail::Items prepare(const Stage& stage) {
        const auto& queue = stage.items();
        if (std::exchange(counted_, nullptr) != queue.counter) count_places(queue);
        const bool selected = queue.flags && order_.policy.compaction == Compaction::select;
        detail::Items items = {
            queue.counter, selected ? order_.list[0] : nullptr, queue.flags, queue.capacity(), nullptr, nullptr, 0};
        if constexpr (Ordered<Order, typename std::remove_cvref_t<decltype(queue)>::value_type>)
            if (order_.policy.ordering == Order::kOrdering && queue.capacity() > 0) sort<Order>(stage, queue, items);
        return items;
    }
    template <class Order, class Stage, class Item>
    void sort(const Stage& stage, const Queue<Item>& queue, detail::Items& items) {
        const uint32_t bits = Order::bits(scene_), last = (1u << bits) - 1;
        const bool whole = queue.flags && !items.list, switched = graph_.active() && !whole;
        const detail::SortSwitch choice = {switched ? graph_.make_condition() : cudaGraphConditionalHandle{}, switched};
        if (queue.keys) {
            detail::fill_keys<<<blocks(detail::fill_keys, kStageBlock), kStageBlock, 0, stream()>>>(
                queue.keys, items, uint16_t(last), choice);
        } else {
            const auto kernel = detail::make_keys<Order, Item>;
            kernel<<<blocks(kernel, kStageBlock), kStageBlock, 0, stream()>>>(scene_, queue, items, last,
                                                                              order_.keys[0], choice);
        }
        if (whole)
            sort_places(order_, queue.keys, queue.capacity(), bits, stream());
        else
            sort_as_many(queue, bits, choice);
        (whole ? items.list : items.sorted) = order_.list[1];
        if constexpr (detail::SkipsMisses<Stage>) {
            if (!queue.keys || whole || !stage.skips_misses()) return;
            items.keys = reinterpret_cast<const uint16_t*>(order_.keys[1]);
            items.end = uint16_t(MaterialOrder::of(scene_, kNone));
        }
    }
    /// Sorts no more places than hold the items. A graph has a sort for each of several sizes, since its launches are
    /// laid down before it is known.
    template <class Item>
    void sort_as_many(const Queue<Item>& queue, uint32_t bits, const detail::SortSwitch& sorts) {
        const auto sort = [&](uint32_t k) {
            if (k < detail::kSortSizes) sort_places(order_, queue.keys, queue.capacity() >> k, bits, stream());
        };
        if (graph_.active())
            graph_.conditional(cudaGraphCondTypeSwitch, sorts.handle, detail::kSortSizes, sort);
        else
            sort(detail::sort_choice(queue.capacity(), size_of(queue.counter)));
    }
    /// Has the counter of a queue by path tell its size; compaction select makes the list too.
    template <class Item>
    void count_places(const Queue<Item>& queue) {
        if (!queue.flags || queue.capacity() == 0) return;
        uint32_t* const n = &queue.counter->count;
        if (order_.policy.compaction == Compaction::select)
            select_places(order_, queue.flags, queue.capacity(), n, stream());
        else
            detail::count_items<<<blocks(detail::count_items, kStageBlock), kStageBlock, 0, stream()>>>(
                queue.flags, queue.capacity(), n);
    }
    template <class Item, class Body>
    void capture_loop(const Queue<Item>& queue, uint32_t least, Body body) {
        const cudaGraphConditionalHandle again = graph_.make_condition();
        const auto ask = [&] {
            count_places(queue);
            detail::repeat_while_any<<<1, 1, 0, stream()>>>(queue.counter, least, again);
        };
        ask();  // before every entry, since a loop inside of a loop is entered more than once
        graph_.conditional(cudaGraphCondTypeWhile, again, 1, [&](uint32_t) {
            body();
            ask();
        });
    }

    uint32_t size_of(const QueueCounter* counter) const {
        QueueCounter c;
        cuda_check(cudaMemcpyAsync(&c, counter, sizeof(c), cudaMemcpyDeviceToHost, stream()), "queue size");
        cuda_check(cudaStreamSynchronize(stream()), "queue size");
        return c.size();
    }
    template <class Stage>
    void finish_over(const Stage& stage, const QueueCounter* stays) {
        finish(stage, nullptr, nullptr, 0, 0, stays);
    }
    template <class Stage>
    void finish(const Stage& stage, QueueCounter* counter, QueueCounter* out = nullptr, uint32_t slots = 0,
                uint32_t samples = 0, const QueueCounter* stays = nullptr) {
        cuda_check(cudaGetLastError(), Stage::kName);
        detail::finish_stage<<<1, 1, 0, stream()>>>(stage.record, counter, out, stays, slots, samples, depth_, state_,
                                                    clock_);
        depth_ = {};
    }
    template <class Stage>
    void finish_extend(const Stage& stage) {
        finish(stage, stage.rays.counter, stage.hits.flags ? nullptr : stage.hits.counter);
    }
    /// As many blocks as can be resident.
    template <class Kernel>
    uint32_t blocks(Kernel* kernel, uint32_t threads) const {
        int per_multiprocessor = 0;
        cuda_check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per_multiprocessor, kernel, int(threads), 0),
                   "occupancy");
        return uint32_t(multiprocessors_ * (per_multiprocessor > 0 ? per_multiprocessor : 1));
    }

    GraphCapture graph_;
    Features traced_;
    std::optional<PairTracer> pairs_;
    const DeviceOptix* optix_ = nullptr;  ///< null: rays are traced by kernels
    HandedRays handed_;
    WaveState* state_;
    uint64_t* clock_;
    SceneView scene_;
    OrderMemory order_;
    const QueueCounter* counted_ = nullptr;  ///< of the queue whose size and list are known before the next launch
    int multiprocessors_ = 0;
    detail::DepthChange depth_{};
    bool may_fail_ = false;
};

}  // namespace ambilux
