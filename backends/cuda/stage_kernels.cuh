// The kernels that an executor launches over slots and items of stages.
#pragma once

#include "backends/cuda/launch_items.cuh"
#include "backends/cuda/trace_kernels.cuh"
#include "stages/connection_loop.h"
#include "stages/multi_bounce.h"

namespace ambilux::detail {

template <class Stage>
__global__ void __launch_bounds__(kStageBlock)
    launch_slots(const __grid_constant__ Stage stage, uint32_t slots, uint32_t samples, WaveState* state) {
    const uint32_t n = slots * (samples ? samples : state->samples);
    in_turns(n, &state->next, [&](uint32_t i) {
        if (i < n) stage(i);
    });
}

/// Over the items of a queue, which stay.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock)
    launch_over(const __grid_constant__ Stage stage, const QueueCounter* counter, WaveState* state) {
    const uint32_t n = counter->size();
    in_turns(n, &state->next, [&](uint32_t i) {
        if (i < n) stage(i);
    });
}
/// The items of a wave are appended to those of all waves.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock)
    launch_append(const __grid_constant__ Stage stage, const QueueCounter* counter, WaveState* state) {
    const uint32_t n = counter->size(), first = state->appended;
    in_turns(n, &state->next, [&](uint32_t i) {
        if (i < n) stage(i, first + i);
    });
}

/// All threads stay until the last slot is done.
template <class Stage>
__global__ void __launch_bounds__(kPathBlock, 1)
    launch_paths(const __grid_constant__ Stage stage, uint32_t slots, const WaveState* state) {
    stage.run(blockIdx.x * kPathBlock + threadIdx.x, slots * state->samples, gridDim.x * kPathBlock);
}

/// The last subpaths of a wave (MultiBounce), as far apart as there are threads for: lanes of a warp wait for each
/// other.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, 3)
    launch_bounces(const __grid_constant__ Stage stage, const QueueCounter* counter) {
    const uint32_t subpaths = counter->size(), threads = gridDim.x * kStageBlock,
                   thread = blockIdx.x * kStageBlock + threadIdx.x;
    uint32_t apart = 1;
    while (apart < 32 && subpaths * apart * 2 <= threads) apart *= 2;
    if (thread % apart == 0) stage.run(thread / apart, subpaths, threads / apart);
}

/// Stages of hits that may have no use for misses.
template <class Stage>
concept SkipsMisses = requires(const Stage& stage) { stage.skips_misses(); };

/// One kernel, however items lie and are ordered: two of them would round differently.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, LaunchTraits<Stage>::kBlocksPerSm)
    launch_items(const __grid_constant__ Stage stage, const Items all) {
    const uint32_t size = all.size();
    const Items items = all.of(size);
    const uint32_t n = SkipsMisses<Stage> ? items.useful(size) : size;
    const auto each = [&](uint32_t i) {
        if (i >= n) return;
        const uint32_t place = items.place(i);
        if (items.claim(place)) stage(place);
    };
    in_turns(n, &items.counter->next, [&](uint32_t i) {
        each(i);
        __syncwarp();  // lanes that part while they push would stay apart
    });
}

/// A warp gathers 32 valid hits before it goes on with them.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, LaunchTraits<Stage>::kBlocksPerSm)
    launch_gathered(const __grid_constant__ Stage stage, const Items all) {
    __shared__ uint32_t gathered[kStageBlock / 32][64];
    const uint32_t n = all.size(), lane = threadIdx.x % 32;
    const Items items = all.of(n);
    uint32_t* const mine = gathered[threadIdx.x / 32];
    const auto& hits = stage.items().items;
    uint32_t held = 0;
    in_turns(n, &items.counter->next, [&](uint32_t i) {
        const uint32_t place = i < n ? items.place(i) : 0;
        const bool valid = i < n && items.claim(place) && hits.template load_last<HitEnd>(place).prim != kNone;
        const uint32_t found = __ballot_sync(0xffffffffu, valid);
        if (valid) mine[held + lane_rank(found)] = place;
        held += uint32_t(__popc(found));
        __syncwarp();
        if (const uint32_t ahead = i + 32; ahead < n && !items.list)
            prefetch_line(hits.base + hits.place(ahead, hits.kLanes - 1));
        if (held < 32) return;
        held -= 32;
        const uint32_t next = mine[held + lane];
        __syncwarp();
        stage(next);
    });
    __syncwarp();
    if (lane < held) stage(mine[lane]);
}

/// A lane that has ended its loop waits until kIdleLanes of its warp have, and begins another together with them. When
/// the capacity is used up, loops are deferred to another launch, those that have not been begun too: as each step
/// fills one slot at most, it is enough that a warp looks at the slots of its own after every step.
template <class Stage>
__global__ void __launch_bounds__(kStageBlock, LaunchTraits<Stage>::kBlocksPerSm)
    launch_loops(const __grid_constant__ Stage stage, const Items all) {
    constexpr uint32_t kWarp = 0xffffffffu, kIdleLanes = 4;
    const uint32_t n = all.size(), threads = gridDim.x * kStageBlock, run = n / threads >= 16 ? 128 : 32,
                   capacity = stage.capacity() > threads ? stage.capacity() - threads : 0;
    const Items items = all.of(n);
    typename Stage::Loop loop = {};
    LoopCount count = {};
    bool busy = false, full = false;
    for (WarpItems claimed;;) {
        const uint32_t idle = __ballot_sync(kWarp, !busy);
        if (claimed.begin < n && uint32_t(__popc(idle)) >= kIdleLanes) {
            const uint32_t next = claimed.claim(idle, &items.counter->next, run);
            if (!busy && next < n) {
                const uint32_t place = items.place(next);
                busy = items.claim(place);
                if (busy) loop = stage.begin(place);
            }
            __syncwarp();
        } else if (idle == kWarp) {
            break;
        }
        if (busy && !full) busy = stage.step(loop, count);
        __syncwarp();
        full = __any_sync(kWarp, full || stage.slot(loop) >= capacity);
        if (busy && (full || stage.one_step())) {
            stage.defer(loop, count);
            busy = false;
        }
        __syncwarp();
    }
    count = {__reduce_add_sync(kWarp, count.steps), __reduce_add_sync(kWarp, count.rays)};
    if (threadIdx.x % 32 == 0) stage.add(count);
}

}  // namespace ambilux::detail
