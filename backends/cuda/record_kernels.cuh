// Kernels around those of stages: counts and keys of items, records, the state of a wave.
#pragma once

#include "backends/cuda/launch_items.cuh"
#include "queues/overflow.h"
#include "stages/order_keys.h"

namespace ambilux::detail {

/// Nanoseconds of the device's clock.
__device__ inline uint64_t device_nanoseconds() {
    uint64_t ns;
    asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(ns));
    return ns;
}

/// Counts the items of a queue of slots by path, 16 flags at a time: memory of flags is a multiple of that, and those
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

/// Which of these sizes is the smallest that holds `items`.
__host__ __device__ inline uint32_t smallest_size(uint32_t capacity, uint32_t items) {
    uint32_t k = 0;
    while (k + 1 < kSortSizes && capacity >> (k + 1) >= items) ++k;
    return k;
}
/// The same; kSortSizes: too few to sort.
__host__ __device__ inline uint32_t sort_choice(uint32_t capacity, uint32_t items) {
    return items < kSortFrom ? kSortSizes : smallest_size(capacity, items);
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

/// `last` for the pairs that are sorted beyond those that there are, if there are `least`. They stay behind those whose
/// key it is: the sort is stable.
template <class Key>
__global__ void __launch_bounds__(kStageBlock)
    pad_keys(Key* keys, const QueueCounter* counter, uint32_t capacity, Key last, uint32_t least, SortSwitch sorts) {
    const uint32_t n = counter->size(), size = n < least ? kSortSizes : smallest_size(capacity, n);
    if (sorts.on && blockIdx.x == 0 && threadIdx.x == 0) cudaGraphSetConditional(sorts.handle, size);
    for (uint32_t i = n + blockIdx.x * kStageBlock + threadIdx.x; i < capacity >> size; i += gridDim.x * kStageBlock)
        keys[i] = last;
}

/// A change of WaveState::depth.
struct DepthChange {
    bool set;  ///< to `value`; otherwise `value` is added
    uint32_t value;
};

/// After a stage: its record, and its queue emptied, or not if it `stays`; `out`, if it is not null, holds as many
/// items as that did. The time since the last such kernel is the stage's.
__global__ inline void finish_stage(StageRecord* record, QueueCounter* counter, QueueCounter* out,
                                    const QueueCounter* stays, uint32_t slots, uint32_t samples, DepthChange depth,
                                    WaveState* state, uint64_t* clock) {
    const uint64_t now = device_nanoseconds();
    state->depth = depth.set ? depth.value : state->depth + depth.value;
    if (out) out->count = counter->size();
    const uint32_t items = counter ? counter->items()
                           : stays ? stays->size()
                                   : slots * (samples ? samples : state->samples);
    record->add(items, state->depth, now - *clock);
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

/// Between the part of a wave that fills queues and the part that uses them: if one of them has overflowed, the wave
/// fails. It has no samples any more, so that the stages that follow find nothing to do, and the film stays as it was.
__global__ inline void fail_on_overflow(WaveState* state, QueueCounter* a, QueueCounter* b) {
    fail_wave_on_overflow(*state, *a, *b);
}

/// For what all waves append to.
__global__ inline void reserve(WaveState* state, QueueCounter* mine, QueueCounter* all) {
    reserve_appended(*state, *mine, *all);
}
__global__ inline void clear_if_failed(const WaveState* state, QueueCounter* counter) {
    if (state->failed) counter->finish();
}

__global__ inline void clear_queue(QueueCounter* counter) { counter->finish(); }

__global__ inline void store(uint32_t* place, uint32_t value) { *place = value; }

__global__ inline void finish_wave(WaveState* state) {
    if (!state->failed) ++state->done;
}

}  // namespace ambilux::detail
