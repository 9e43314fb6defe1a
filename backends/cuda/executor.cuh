// Runs the stages of one wave on a CUDA device. They are captured into a graph whose loop over depths is a conditional node; sizes of queues are read on the
// device: between the launch of a graph and its end the host does nothing. The same can be launched kernel by kernel, for profilers and sanitizers.
#pragma once

#include <cuda_runtime.h>

#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "backends/cuda/device_memory.h"
#include "backends/cuda/order.h"
#include "backends/cuda/trace_kernels.cuh"
#include "queues/queue.h"
#include "stages/order_keys.h"
#include "stages/settle.h"
#include "stages/stage.h"
#include "stages/tail.h"
#include "stages/wave.h"

#if CUDART_VERSION < 12080
#error "Graphs that choose one of several bodies need CUDA 12.8 or newer"
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

/// From so many items on a sort pays; fewer are shaded in the time that its launches take.
constexpr uint32_t kSortFrom = 1u << 15;

/// The items that a launch goes through.
struct Items {
    QueueCounter* counter;
    const uint32_t* list;  ///< their places; null: places 0, 1, 2 ...
    uint8_t* flags;        ///< Queue::flags
    uint32_t capacity;
    const uint32_t* sorted;  ///< instead of `list` if there are at least kSortFrom items; null: never
    const uint16_t* keys;    ///< that `sorted` is in the order of; null: every item is to be looked at
    uint16_t end;            ///< key from which on nothing comes of items

    /// Places to look at.
    __device__ uint32_t size() const { return flags && !list ? capacity : counter->size(); }
    /// What to go through when size() is `n`.
    __device__ Items of(uint32_t n) const {
        const bool in_order = sorted && n >= kSortFrom;
        return {counter, in_order ? sorted : list, flags, capacity, nullptr, in_order ? keys : nullptr, end};
    }
    /// How many of the first n items something may come of, which all threads of a block ask together.
    __device__ uint32_t worth(uint32_t n) const {
        if (!keys) return n;
        uint32_t first = 0, last = n;  // what is asked for lies between them
        while (first < last) {
            const uint32_t step = (last - first + kStageBlock - 1) / kStageBlock, probe = first + threadIdx.x * step;
            const uint32_t below = uint32_t(__syncthreads_count(probe < last && keys[probe] < end));
            if (below == 0) return first;
            last = min(last, first + below * step);
            first += (below - 1) * step + 1;
        }
        return first;
    }
    __device__ uint32_t place(uint32_t i) const { return list ? list[i] : i; }
    /// False if there is no item. What is taken must be used: its place is empty from now on.
    __device__ bool take(uint32_t place) const {
        if (!flags) return true;
        if (!list && !flags[place]) return false;
        flags[place] = 0;
        return true;
    }
};

template <class Stage>
__global__ void __launch_bounds__(kStageBlock) launch_slots(const __grid_constant__ Stage stage, uint32_t slots, uint32_t samples, const WaveState* state) {
    const uint32_t n = slots * (samples ? samples : state->samples);
    for (uint32_t i = blockIdx.x * kStageBlock + threadIdx.x; i < n; i += gridDim.x * kStageBlock) stage(i);
}

/// All threads stay until the last slot is done.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, Stage::kBlocksPerSm) launch_paths(const __grid_constant__ Stage stage, uint32_t slots, const WaveState* state) {
    stage.run(blockIdx.x * kStageBlock + threadIdx.x, slots * state->samples, gridDim.x * kStageBlock);
}

/// The last walks of a wave (stages/tail.h), as far apart as there are threads for: lanes of a warp wait for each other.
template <class Tail>
__global__ void __launch_bounds__(kStageBlock, 3) launch_tail(const __grid_constant__ Tail tail, const QueueCounter* counter) {
    const uint32_t walks = counter->size(), threads = gridDim.x * kStageBlock, thread = blockIdx.x * kStageBlock + threadIdx.x;
    uint32_t apart = 1;
    while (apart < 32 && walks * apart * 2 <= threads) apart *= 2;
    if (thread % apart == 0) tail.run(thread / apart, walks, threads / apart);
}

/// Blocks of a stage that are to be resident on a multiprocessor: 1 leaves registers to the compiler.
template <class Stage>
constexpr uint32_t blocks_per_multiprocessor() {
    if constexpr (requires { Stage::kBlocksPerSm; }) return Stage::kBlocksPerSm;
    return 1;
}

/// Stages of hits that may have no use for rays that met nothing.
template <class Stage>
concept SkipsMisses = requires(const Stage& stage) { stage.skips_misses(); };

/// Stages of hits that never have that use, and whose hits are never sorted.
template <class Stage>
concept Gathered = requires { requires Stage::kGathers; };

/// One kernel, however items lie and are ordered: two of them would round differently.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, blocks_per_multiprocessor<Stage>()) launch_items(const __grid_constant__ Stage stage, const Items all) {
    const uint32_t size = all.size();
    const Items items = all.of(size);
    const uint32_t n = SkipsMisses<Stage> ? items.worth(size) : size;
    for (uint32_t i = blockIdx.x * kStageBlock + threadIdx.x; i < n; i += gridDim.x * kStageBlock) {
        const uint32_t place = items.place(i);
        if (items.take(place)) stage(place);
    }
}

/// A warp gathers 32 hits that are some before it goes on with them.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, blocks_per_multiprocessor<Stage>()) launch_gathered(const __grid_constant__ Stage stage, const Items all) {
    __shared__ uint32_t gathered[kStageBlock / 32][64];
    const uint32_t n = all.size(), lane = threadIdx.x % 32;
    const Items items = all.of(n);
    uint32_t* const mine = gathered[threadIdx.x / 32];
    uint32_t held = 0;
    for (uint32_t first = blockIdx.x * kStageBlock + threadIdx.x - lane; first < n; first += gridDim.x * kStageBlock) {
        const uint32_t i = first + lane, place = i < n ? items.place(i) : 0;
        const bool some = i < n && items.take(place) && stage.hits.template last<HitEnd>(place).prim != kNone;
        const uint32_t found = __ballot_sync(0xffffffffu, some);
        if (some) mine[held + lane_rank(found)] = place;
        held += uint32_t(__popc(found));
        __syncwarp();
        if (const uint32_t ahead = i + gridDim.x * kStageBlock; ahead < n && !items.list) asm volatile("prefetch.global.L2 [%0];" ::"l"(stage.hits.base + stage.hits.place(ahead, stage.hits.kLanes - 1)));
        if (held < 32) continue;
        held -= 32;
        const uint32_t next = mine[held + lane];
        __syncwarp();
        stage(next);
    }
    __syncwarp();
    if (lane < held) stage(mine[lane]);
}

/// Stages that can tell of an item, with less than it takes, that nothing will come of it.
template <class Stage>
concept Filtered = requires(const Stage& stage) { stage.relevant(0u); };

/// A block looks through a stretch of items first, so that its warps are full of those that matter.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, blocks_per_multiprocessor<Stage>()) launch_filtered(const __grid_constant__ Stage stage, const Items all) {
    constexpr uint32_t kMost = 8 * kStageBlock;
    __shared__ uint32_t relevant[kMost], count;
    const uint32_t n = all.size();
    const Items items = all.of(n);
    const uint32_t stretch = min(kMost, (n / gridDim.x / kStageBlock + 1) * kStageBlock);
    for (uint32_t first = blockIdx.x * stretch; first < n; first += gridDim.x * stretch) {
        if (threadIdx.x == 0) count = 0;
        __syncthreads();
        for (uint32_t i = first + threadIdx.x; i < min(n, first + stretch); i += kStageBlock) {
            const uint32_t place = items.place(i);
            if (items.take(place) && stage.relevant(place)) relevant[atomicAdd(&count, 1u)] = place;
        }
        __syncthreads();
        for (uint32_t i = threadIdx.x; i < count; i += kStageBlock) stage.connect(relevant[i]);
        __syncthreads();
    }
}

/// Rays in the order of the queue, one after the other: best while neighbours stay together. `Set`: what traversal has to know of; less than the stage does, where
/// the scene lets it.
template <class Set, class Stage, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm) launch_coherent(const __grid_constant__ Stage stage, const Tracer tracer, const Items all) {
    static_assert(!Stage::kAnyHit);
    const uint32_t n = all.size();
    const Items items = all.of(n);
    for (uint32_t i = blockIdx.x * kTraceBlock + threadIdx.x; i < n; i += gridDim.x * kTraceBlock) {
        const uint32_t place = items.place(i);
        Ray ray;
        if (!items.take(place) || !stage.fetch(place, ray)) continue;
        Hit hit;
        tracer.template closest<Set::value>(stage.scene, ray, hit);
        stage.finish(place, hit);
    }
}

/// Camera rays, traced as soon as they are made. They are in memory for the stages that follow; each knows its place, since adding to a counter takes longer than tracing it.
template <class Set, class Generate, class Stage, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    launch_camera_rays(const __grid_constant__ Generate generate, const __grid_constant__ Stage stage, const Tracer tracer, uint32_t slots, const WaveState* state) {
    const uint32_t n = slots * state->samples;
    if (blockIdx.x == 0 && threadIdx.x == 0) stage.rays.counter->count = generate.wave.active_before(n);
    for (uint32_t i = blockIdx.x * kTraceBlock + threadIdx.x; i < n; i += gridDim.x * kTraceBlock) {
        auto item = decltype(stage.rays.load(0)){};
        if (!generate.make(i, item)) continue;
        const uint32_t place = generate.wave.active_before(i);
        if constexpr (requires { item.kKnownLane; })
            stage.rays.store_but(place, item.kKnownLane, item);
        else
            stage.rays.store(place, item);
        Ray ray;
        Hit hit = {0.0f, 0.0f, 0.0f, kNone};
        if (stage.fetch(item, ray)) tracer.template closest<Set::value>(stage.scene, ray, hit);
        stage.finish(place, hit);
    }
}

/// Rays by persistent threads.
template <class Set, class Stage, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm) launch_trace(const __grid_constant__ Stage stage, const Tracer tracer, const Items all) {
    const uint32_t n = all.size();
    const Items items = all.of(n);
    if constexpr (Stage::kAnyHit) {
        __shared__ typename Stage::Kept kept[kTraceBlock];
        constexpr bool loose = requires { requires Stage::kPushesLoosely; };
        static_assert(kTraceBlock / 32 <= WarpStretches::kMostWarps);
        if constexpr (loose) WarpStretches::mine().open(n);
        const auto fetch = [&](uint32_t i, Ray& ray) {
            const uint32_t place = items.place(i);
            return items.take(place) && stage.fetch(place, ray, kept[threadIdx.x]);
        };
        trace_any_persistent<Set::value>(stage.scene, tracer, fetch, [&](uint32_t i, bool blocked) { stage.finish(items.place(i), kept[threadIdx.x], blocked); }, &n, &items.counter->next);
        if constexpr (loose) WarpStretches::mine().close();
    } else {
        const auto fetch = [&](uint32_t i, Ray& ray) {
            const uint32_t place = items.place(i);
            return items.take(place) && stage.fetch(place, ray);
        };
        trace_closest_persistent<Set::value>(stage.scene, tracer, fetch, [&](uint32_t i, const Hit& hit) { stage.finish(items.place(i), hit); }, &n, &items.counter->next);
    }
}

/// Counts the items of a queue of fixed places, 16 flags at a time: memory of flags is a multiple of that, and those past the capacity are 0.
__global__ inline void count_items(const uint8_t* flags, uint32_t capacity, uint32_t* count) {
    uint32_t mine = 0;
    for (uint32_t i = (blockIdx.x * kStageBlock + threadIdx.x) * 16; i < capacity; i += gridDim.x * kStageBlock * 16) {
        const uint4 word = *reinterpret_cast<const uint4*>(flags + i);
        mine += uint32_t(__popc(word.x) + __popc(word.y) + __popc(word.z) + __popc(word.w));
    }
    const uint32_t warp = __reduce_add_sync(0xffffffffu, mine);
    if (threadIdx.x % 32 == 0 && warp) atomicAdd(count, warp);
}

/// Sorts run over all places of a queue, or a half, a quarter ... of them.
constexpr uint32_t kSortSizes = 11;

/// Which of these sizes is the smallest that holds `items`; kSortSizes: too few to sort.
__host__ __device__ inline uint32_t sort_choice(uint32_t capacity, uint32_t items) {
    if (items < kSortFrom) return kSortSizes;
    uint32_t k = 0;
    while (k + 1 < kSortSizes && capacity >> (k + 1) >= items) ++k;
    return k;
}

/// Where a graph has a sort for each size: the conditional node that runs one of them.
struct SortSwitch {
    cudaGraphConditionalHandle handle;
    bool on;
};

/// Places that will be sorted for a launch over `n` items. Tells `sorts` which size that is.
__device__ inline uint32_t places_to_sort(const Items& items, uint32_t n, SortSwitch sorts) {
    const uint32_t choice = sort_choice(items.capacity, n);
    if (sorts.on && blockIdx.x == 0 && threadIdx.x == 0) cudaGraphSetConditional(sorts.handle, choice);
    return items.flags && !items.list ? n : choice < kSortSizes ? items.capacity >> choice : 0;
}

/// Keys of the items that a launch will go through. The last key is that of places without an item.
template <class Order, class Item>
__global__ void __launch_bounds__(kStageBlock) make_keys(const __grid_constant__ SceneView scene, const Queue<Item> queue, const Items items, uint32_t last, uint32_t* keys, SortSwitch sorts) {
    const uint32_t n = items.size(), end = places_to_sort(items, n, sorts);
    for (uint32_t i = blockIdx.x * kStageBlock + threadIdx.x; i < end; i += gridDim.x * kStageBlock) {
        uint32_t key = last;
        if (i < n) {
            const uint32_t place = items.place(i);
            if (items.list || !items.flags || items.flags[place]) key = order_key<Order>(scene, queue, place);
        }
        keys[i] = key;
    }
}

/// The same for items that have their keys.
__global__ inline void __launch_bounds__(kStageBlock) fill_keys(uint16_t* keys, const Items items, uint16_t last, SortSwitch sorts) {
    const uint32_t n = items.size(), end = places_to_sort(items, n, sorts);
    for (uint32_t i = n + blockIdx.x * kStageBlock + threadIdx.x; i < end; i += gridDim.x * kStageBlock) keys[i] = last;
}

/// A change of WaveState::depth.
struct DepthChange {
    bool set;           ///< to `value`; otherwise `value` is added
    uint32_t value;
};

/// After a stage: its record, and its queue emptied; `out`, if it is not null, holds as many items as that did. The time since the last such kernel is the stage's.
__global__ inline void finish_stage(StageRecord* record, QueueCounter* counter, QueueCounter* out, uint32_t slots, uint32_t samples, bool keep, DepthChange depth, WaveState* state, uint64_t* clock) {
    const uint64_t now = device_nanoseconds();
    state->depth = depth.set ? depth.value : state->depth + depth.value;
    if (out) out->count = counter->size();
    record->add(counter ? counter->items() : slots * (samples ? samples : state->samples), state->depth, now - *clock);
    if (counter && !keep) counter->finish();
    *clock = now;
}

__global__ inline void start_clock(uint64_t* clock) { *clock = device_nanoseconds(); }

__global__ inline void repeat_while_any(const QueueCounter* counter, uint32_t least, cudaGraphConditionalHandle again) { cudaGraphSetConditional(again, counter->count >= least); }

/// A failed wave stays failed, and those after it do nothing.
__global__ inline void set_wave(WaveState* state, WaveState value) {
    value.failed = state->failed;
    value.done = state->done;
    if (value.failed) value.samples = 0;
    *state = value;
}

__global__ inline void settle_queues(WaveState* state, QueueCounter* a, QueueCounter* b) { settle(*state, *a, *b); }

__global__ inline void clear_queue(QueueCounter* counter) { counter->finish(); }

__global__ inline void finish_wave(WaveState* state) {
    if (!state->failed) ++state->done;
}

}  // namespace detail

/// Executor of a schedule (integrators/path/schedule.h). `kPairs`: kernels are made for binary BVHs too.
template <bool kPairs>
class BasicCudaExecutor {
public:
    static constexpr bool kTails = true;  ///< has run_tail

    /// `traced`: features that rays have to know of, the scene's or more. `clock`: one value on the device.
    BasicCudaExecutor(cudaStream_t stream, const Features& traced, WaveState* state, StageRecord* records, uint64_t* clock, const SceneView& scene, const OrderMemory& order)
        : stream_(stream), traced_(traced), state_(state), records_(records), clock_(clock), scene_(scene), order_(order) {
        int device = 0;
        cuda_check(cudaGetDevice(&device), "device");
        cuda_check(cudaDeviceGetAttribute(&multiprocessors_, cudaDevAttrMultiProcessorCount, device), "multiprocessors");
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
        detail::launch_slots<<<blocks(detail::launch_slots<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, slots, samples, state_);
        finish(id, nullptr, nullptr, slots, samples);
    }
    template <class Stage>
    void run_paths(StageId id, const Stage& stage, uint32_t slots) {
        detail::launch_paths<<<blocks(detail::launch_paths<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, slots, state_);
        finish(id, nullptr, nullptr, slots);
    }
    template <class Stage, class Item>
    void run(StageId id, const Stage& stage, const Queue<Item>& queue) {
        const detail::Items items = prepare<MaterialOrder>(stage, queue);
        if constexpr (detail::Gathered<Stage>)
            detail::launch_gathered<<<blocks(detail::launch_gathered<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, items);
        else if constexpr (detail::Filtered<Stage>)
            detail::launch_filtered<<<blocks(detail::launch_filtered<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, items);
        else
            detail::launch_items<<<blocks(detail::launch_items<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, items);
        finish(id, queue.counter);
    }
    /// Several depths of the walks of `hits`, which must be appended.
    template <class Shade, class Extend, class Item>
    void run_tail(StageId id, const Shade& shade, const Extend& extend, const Queue<Item>& hits) {
        using Kernel = Tail<Shade, Extend>;
        detail::launch_tail<<<blocks(detail::launch_tail<Kernel>, kStageBlock), kStageBlock, 0, stream_>>>(Kernel{shade, extend}, hits.counter);
        finish(id, hits.counter);
    }
    /// Items stay where they are until clear().
    template <class Stage, class Item>
    void run_keeping(StageId id, const Stage& stage, const Queue<Item>& queue) {
        const detail::Items items = prepare<void>(stage, queue);
        detail::launch_items<<<blocks(detail::launch_items<Stage>, kStageBlock), kStageBlock, 0, stream_>>>(stage, items);
        finish(id, queue.counter, nullptr, 0, 0, true);
    }
    /// Rays go through `pairs` instead of the tracer of their stage.
    void use(const PairTracer& pairs) requires kPairs { pairs_ = pairs; }

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
            const auto kernel = detail::launch_camera_rays<decltype(set), Generate, Extend, std::remove_cvref_t<decltype(tracer)>>;
            kernel<<<blocks(kernel, kTraceBlock), kTraceBlock, 0, stream_>>>(generate, extend, tracer, slots, state_);
        });
        finish(StageId::extend, extend.rays.counter, extend.hits.counter);
    }
    /// From the next record on; no kernel but those that keep records asks.
    void set_depth(uint32_t depth) { depth_ = {true, depth}; }
    void next_depth(uint32_t depths = 1) { depth_.value += depths; }

    template <class A, class B>
    void settle(const A& a, const B& b) {
        detail::settle_queues<<<1, 1, 0, stream_>>>(state_, a.counter, b.counter);
    }
    template <class Item, LaneOrder Order>
    void clear(const Queue<Item, Order>& queue) {
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
    /// f(FeatureSet, tracer) with the set that tracing needs. Kernels are made only for sets that the stage's own features cover.
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

    /// What a launch over `queue` goes through, sorted if it is to be. A loop has counted its queue already when its body begins with that queue.
    template <class Order, class Stage, class Item>
    detail::Items prepare(const Stage& stage, const Queue<Item>& queue) {
        const bool counted = counted_ == queue.counter;
        counted_ = nullptr;
        if (!counted) count(queue);
        const bool selected = queue.flags && order_.policy.compaction == Compaction::select;
        detail::Items items = {queue.counter, selected ? order_.list[0] : nullptr, queue.flags, queue.capacity, nullptr, nullptr, 0};
        if constexpr (Ordered<Order, Item>) {
            if (order_.policy.ordering == Order::kOrdering && queue.capacity > 0) {
                const uint32_t bits = Order::bits(scene_);
                const bool whole = queue.flags && !items.list;
                const detail::SortSwitch choice = {capturing_ && !whole ? make_condition() : cudaGraphConditionalHandle{}, capturing_ && !whole};
                const uint32_t last = (1u << bits) - 1;
                if (queue.keys)
                    detail::fill_keys<<<blocks(detail::fill_keys, kStageBlock), kStageBlock, 0, stream_>>>(queue.keys, items, uint16_t(last), choice);
                else
                    detail::make_keys<Order, Item><<<blocks(detail::make_keys<Order, Item>, kStageBlock), kStageBlock, 0, stream_>>>(scene_, queue, items, last, order_.keys[0], choice);
                if (whole)
                    sort_places(order_, queue.keys, queue.capacity, bits, stream_);
                else
                    sort_as_many(queue, bits, choice);
                (whole ? items.list : items.sorted) = order_.list[1];
                if constexpr (detail::SkipsMisses<Stage>) {
                    if (queue.keys && !whole && stage.skips_misses()) items.keys = reinterpret_cast<const uint16_t*>(order_.keys[1]), items.end = uint16_t(MaterialOrder::of(scene_, kNone));
                }
            }
        }
        return items;
    }
    /// Sorts no more places than hold the items. A graph has a sort for each of several sizes, since its launches are laid down before it is known.
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
            detail::count_items<<<blocks(detail::count_items, kStageBlock), kStageBlock, 0, stream_>>>(queue.flags, queue.capacity, &queue.counter->count);
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
        cuda_check(cudaGraphConditionalHandleCreate(&handle, captured().first, 0, cudaGraphCondAssignDefault), "conditional handle");
        return handle;
    }
    /// `bodies` graphs, of which body(k) captures the k-th.
    template <class Body>
    void capture_conditional(cudaGraphConditionalNodeType type, cudaGraphConditionalHandle handle, uint32_t bodies, Body body) {
        const auto [graph, dependencies] = captured();
        cudaGraphNodeParams params = {};
        params.type = cudaGraphNodeTypeConditional;
        params.conditional.handle = handle;
        params.conditional.type = type;
        params.conditional.size = bodies;
        cudaGraphNode_t node = nullptr;
#if CUDART_VERSION >= 13000
        cuda_check(cudaGraphAddNode(&node, graph, dependencies.data(), nullptr, dependencies.size(), &params), "conditional node");
        cuda_check(cudaStreamUpdateCaptureDependencies(stream_, &node, nullptr, 1, cudaStreamSetCaptureDependencies), "conditional node");
#else
        cuda_check(cudaGraphAddNode(&node, graph, dependencies.data(), dependencies.size(), &params), "conditional node");
        cuda_check(cudaStreamUpdateCaptureDependencies(stream_, &node, 1, cudaStreamSetCaptureDependencies), "conditional node");
#endif

        const cudaStream_t outer = stream_;
        cuda_check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream");
        for (uint32_t k = 0; k < bodies; ++k) {
            cuda_check(cudaStreamBeginCaptureToGraph(stream_, params.conditional.phGraph_out[k], nullptr, nullptr, 0, cudaStreamCaptureModeThreadLocal), "begin of conditional capture");
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
        cuda_check(cudaStreamGetCaptureInfo(stream_, &status, nullptr, &graph, &nodes, nullptr, &count), "graph capture");
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
    void finish(StageId id, QueueCounter* counter, QueueCounter* out = nullptr, uint32_t slots = 0, uint32_t samples = 0, bool keep = false) {
        cuda_check(cudaGetLastError(), kStageNames[uint32_t(id)]);
        detail::finish_stage<<<1, 1, 0, stream_>>>(records_ + uint32_t(id), counter, out, slots, samples, keep, depth_, state_, clock_);
        depth_ = {};
    }
    /// As many blocks as can be resident.
    template <class Kernel>
    uint32_t blocks(Kernel* kernel, uint32_t threads) const {
        int per_multiprocessor = 0;
        cuda_check(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per_multiprocessor, kernel, int(threads), 0), "occupancy");
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
