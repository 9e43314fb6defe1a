// The kernels that an executor launches: over slots, paths and queues, for rays, for the order of items, and those of
// one thread that keep records.
#pragma once

#include <cuda_runtime.h>

#include "backends/cuda/trace_kernels.cuh"
#include "items/path_items.h"
#include "queues/queue.h"
#include "queues/wave.h"
#include "stages/chain.h"
#include "stages/order_keys.h"
#include "stages/settle.h"
#include "stages/stage.h"

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

/// body(i), by whole warps, for all i below n and for as many more as fill a warp. Warps take their next stretch of
/// items when they are done with the last: what is in work lies together, so that all run the same material, and none
/// has more to do than others. Stretches are long, since taking one waits, but not so long that warps would end far
/// apart; where items are few, each warp has its own. *next must be 0 when the kernel starts.
template <class Body>
__device__ void in_turns(uint32_t n, uint32_t* next, Body body) {
    const uint32_t lane = threadIdx.x % 32, threads = gridDim.x * blockDim.x,
                   stretch = n / threads >= 64   ? 256
                             : n / threads >= 16 ? 64
                                                 : 32;
    uint32_t i = (blockIdx.x * blockDim.x + threadIdx.x) / 32 * stretch + lane;
    while (i - lane < n) {
        body(i);
        i += 32;
        if ((i & (stretch - 1)) >= 32) continue;
        if (stretch == 32) {
            i += threads - 32;
            continue;
        }
        __syncwarp();
        uint32_t taken = 0;
        if (lane == 0) taken = add_to(next, stretch);
        i = threads / 32 * stretch + __shfl_sync(0xffffffffu, taken, 0) + lane;
    }
}

template <class Stage>
__global__ void __launch_bounds__(kStageBlock)
    launch_slots(const __grid_constant__ Stage stage, uint32_t slots, uint32_t samples, WaveState* state) {
    const uint32_t n = slots * (samples ? samples : state->samples);
    in_turns(n, &state->next, [&](uint32_t i) {
        if (i < n) stage(i);
    });
}

/// All threads stay until the last slot is done.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, Stage::kBlocksPerSm)
    launch_paths(const __grid_constant__ Stage stage, uint32_t slots, const WaveState* state) {
    stage.run(blockIdx.x * kStageBlock + threadIdx.x, slots * state->samples, gridDim.x * kStageBlock);
}

/// The last walks of a wave (stages/tail.h), as far apart as there are threads for: lanes of a warp wait for each
/// other.
template <class Tail>
__global__ void __launch_bounds__(kStageBlock, 3)
    launch_tail(const __grid_constant__ Tail tail, const QueueCounter* counter) {
    const uint32_t walks = counter->size(), threads = gridDim.x * kStageBlock,
                   thread = blockIdx.x * kStageBlock + threadIdx.x;
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
__global__ void __launch_bounds__(kStageBlock, blocks_per_multiprocessor<Stage>())
    launch_items(const __grid_constant__ Stage stage, const Items all) {
    const uint32_t size = all.size();
    const Items items = all.of(size);
    const uint32_t n = SkipsMisses<Stage> ? items.worth(size) : size;
    const auto each = [&](uint32_t i) {
        if (i >= n) return;
        const uint32_t place = items.place(i);
        if (items.take(place)) stage(place);
    };
    in_turns(n, &items.counter->next, [&](uint32_t i) {
        each(i);
        __syncwarp();  // lanes that part while they push would stay apart
    });
}

/// A warp gathers 32 hits that are some before it goes on with them.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, blocks_per_multiprocessor<Stage>())
    launch_gathered(const __grid_constant__ Stage stage, const Items all) {
    __shared__ uint32_t gathered[kStageBlock / 32][64];
    const uint32_t n = all.size(), lane = threadIdx.x % 32;
    const Items items = all.of(n);
    uint32_t* const mine = gathered[threadIdx.x / 32];
    uint32_t held = 0;
    in_turns(n, &items.counter->next, [&](uint32_t i) {
        const uint32_t place = i < n ? items.place(i) : 0;
        const bool some = i < n && items.take(place) && stage.hits.template last<HitEnd>(place).prim != kNone;
        const uint32_t found = __ballot_sync(0xffffffffu, some);
        if (some) mine[held + lane_rank(found)] = place;
        held += uint32_t(__popc(found));
        __syncwarp();
        if (const uint32_t ahead = i + 32; ahead < n && !items.list)
            asm volatile(
                "prefetch.global.L2 [%0];" ::"l"(stage.hits.base + stage.hits.place(ahead, stage.hits.kLanes - 1)));
        if (held < 32) return;
        held -= 32;
        const uint32_t next = mine[held + lane];
        __syncwarp();
        stage(next);
    });
    __syncwarp();
    if (lane < held) stage(mine[lane]);
}

/// A lane that has ended its chain waits until kIdleLanes of its warp have, and begins another together with them. When
/// there is no more room, chains go back for another launch, those that have not been begun too: as each step fills one
/// place at most, it is enough that a warp looks at the places of its own after every step.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, Stage::kBlocksPerSm)
    launch_chains(const __grid_constant__ Stage stage, const Items all) {
    constexpr uint32_t kWarp = 0xffffffffu, kIdleLanes = 4;
    const uint32_t n = all.size(), threads = gridDim.x * kStageBlock, stretch = n / threads >= 16 ? 128 : 32,
                   room = stage.room() > threads ? stage.room() - threads : 0;
    const Items items = all.of(n);
    typename Stage::Chain chain = {};
    ChainCount count = {};
    bool busy = false, full = false;
    for (WarpItems taken;;) {
        const uint32_t idle = __ballot_sync(kWarp, !busy);
        if (taken.begin < n && uint32_t(__popc(idle)) >= kIdleLanes) {
            const uint32_t next = taken.take(idle, &items.counter->next, stretch);
            if (!busy && next < n) {
                const uint32_t place = items.place(next);
                busy = items.take(place);
                if (busy) chain = stage.begin(place);
            }
            __syncwarp();
        } else if (idle == kWarp) {
            break;
        }
        if (busy && !full) busy = stage.step(chain, count);
        __syncwarp();
        full = __any_sync(kWarp, full || stage.place(chain) >= room);
        if (busy && (full || stage.one_step())) {
            stage.put_back(chain, count);
            busy = false;
        }
        __syncwarp();
    }
    count = {__reduce_add_sync(kWarp, count.steps), __reduce_add_sync(kWarp, count.rays)};
    if (threadIdx.x % 32 == 0) stage.add(count);
}

/// Rays in the order of the queue, one after the other: best while neighbours stay together. `Set`: what traversal has
/// to know of; less than the stage does, where the scene lets it.
template <class Set, class Stage, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    launch_coherent(const __grid_constant__ Stage stage, const Tracer tracer, const Items all) {
    static_assert(!Stage::kAnyHit);
    const uint32_t n = all.size();
    const Items items = all.of(n);
    in_turns(n, &items.counter->next, [&](uint32_t i) {
        if (i >= n) return;
        const uint32_t place = items.place(i);
        Ray ray;
        if (!items.take(place) || !stage.fetch(place, ray)) return;
        Hit hit;
        tracer.template closest<Set::value>(stage.scene, ray, hit);
        stage.finish(place, hit);
    });
}

/// Camera rays, traced as soon as they are made. They are in memory for the stages that follow; each knows its place,
/// since adding to a counter takes longer than tracing it.
template <class Set, class Generate, class Stage, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    launch_camera_rays(const __grid_constant__ Generate generate, const __grid_constant__ Stage stage,
                       const Tracer tracer, uint32_t slots, const WaveState* state) {
    const uint32_t n = slots * state->samples;
    if (blockIdx.x == 0 && threadIdx.x == 0) stage.rays.counter->count = generate.wave.active_before(n);
    in_turns(n, &stage.rays.counter->next, [&](uint32_t i) {
        auto item = decltype(stage.rays.load(0)){};
        if (i >= n || !generate.make(i, item)) return;
        const uint32_t place = generate.wave.active_before(i);
        if constexpr (requires { item.kKnownLane; })
            stage.rays.store_but(place, item.kKnownLane, item);
        else
            stage.rays.store(place, item);
        Ray ray;
        Hit hit = {0.0f, 0.0f, 0.0f, kNone};
        if (stage.fetch(item, ray)) tracer.template closest<Set::value>(stage.scene, ray, hit);
        stage.finish(place, hit);
    });
}

/// Rays by persistent threads.
template <class Set, class Stage, class Tracer>
__global__ void __launch_bounds__(kTraceBlock, kTraceBlocksPerSm)
    launch_trace(const __grid_constant__ Stage stage, const Tracer tracer, const Items all) {
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
        trace_any_persistent<Set::value>(
            stage.scene, tracer, fetch,
            [&](uint32_t i, bool blocked) { stage.finish(items.place(i), kept[threadIdx.x], blocked); }, &n,
            &items.counter->next);
        if constexpr (loose) WarpStretches::mine().close();
    } else {
        const auto fetch = [&](uint32_t i, Ray& ray) {
            const uint32_t place = items.place(i);
            return items.take(place) && stage.fetch(place, ray);
        };
        trace_closest_persistent<Set::value>(
            stage.scene, tracer, fetch, [&](uint32_t i, const Hit& hit) { stage.finish(items.place(i), hit); }, &n,
            &items.counter->next);
    }
}

/// Counts the items of a queue of fixed places, 16 flags at a time: memory of flags is a multiple of that, and those
/// past the capacity are 0.
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
__global__ void __launch_bounds__(kStageBlock)
    make_keys(const __grid_constant__ SceneView scene, const Queue<Item> queue, const Items items, uint32_t last,
              uint32_t* keys, SortSwitch sorts) {
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
__global__ inline void __launch_bounds__(kStageBlock)
    fill_keys(uint16_t* keys, const Items items, uint16_t last, SortSwitch sorts) {
    const uint32_t n = items.size(), end = places_to_sort(items, n, sorts);
    for (uint32_t i = n + blockIdx.x * kStageBlock + threadIdx.x; i < end; i += gridDim.x * kStageBlock) keys[i] = last;
}

/// A change of WaveState::depth.
struct DepthChange {
    bool set;  ///< to `value`; otherwise `value` is added
    uint32_t value;
};

/// After a stage: its record, and its queue emptied; `out`, if it is not null, holds as many items as that did. The
/// time since the last such kernel is the stage's.
__global__ inline void finish_stage(StageRecord* record, QueueCounter* counter, QueueCounter* out, uint32_t slots,
                                    uint32_t samples, DepthChange depth, WaveState* state, uint64_t* clock) {
    const uint64_t now = device_nanoseconds();
    state->depth = depth.set ? depth.value : state->depth + depth.value;
    if (out) out->count = counter->size();
    record->add(counter ? counter->items() : slots * (samples ? samples : state->samples), state->depth, now - *clock);
    if (counter) counter->finish();
    (counter ? counter->next : state->next) = 0;
    *clock = now;
}

__global__ inline void start_clock(uint64_t* clock) { *clock = device_nanoseconds(); }

__global__ inline void repeat_while_any(const QueueCounter* counter, uint32_t least, cudaGraphConditionalHandle again) {
    cudaGraphSetConditional(again, counter->count >= least);
}

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

}  // namespace ambilux
