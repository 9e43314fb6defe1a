// The kernels that an executor launches over the rays of stages. `Set`: what traversal has to know of; less than the
// stage does, where the scene lets it.
#pragma once

#include "backends/cuda/launch_items.cuh"
#include "backends/cuda/trace_kernels.cuh"
#include "queues/reserved_queue.h"
#include "queues/wave.h"

namespace ambilux::detail {

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
        if (!items.claim(place) || !stage.fetch(place, ray)) return;
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
        if constexpr (requires { item.kCameraLane; })
            stage.rays.items.store_but(place, item.kCameraLane, item);
        else
            stage.rays.items.store(place, item);
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
        constexpr bool reserves = requires { requires Stage::kReservesSlots; };
        static_assert(kTraceBlock / 32 <= ReservedSlots::kMostWarps);
        if constexpr (reserves) ReservedSlots::of_block().open(n);
        const auto fetch = [&](uint32_t i, Ray& ray) {
            const uint32_t place = items.place(i);
            return items.claim(place) && stage.fetch(place, ray, kept[threadIdx.x]);
        };
        trace_any_persistent<Set::value>(
            stage.scene, tracer, fetch,
            [&](uint32_t i, bool blocked) { stage.finish(items.place(i), kept[threadIdx.x], blocked); }, &n,
            &items.counter->next);
        if constexpr (reserves) ReservedSlots::of_block().close();
    } else {
        const auto fetch = [&](uint32_t i, Ray& ray) {
            const uint32_t place = items.place(i);
            return items.claim(place) && stage.fetch(place, ray);
        };
        trace_closest_persistent<Set::value>(
            stage.scene, tracer, fetch, [&](uint32_t i, const Hit& hit) { stage.finish(items.place(i), hit); }, &n,
            &items.counter->next);
    }
}

}  // namespace ambilux::detail
