// The kernels around the launches of another tracer: rays of a stage's items are handed over, and hits taken back.
#pragma once

#include "backends/cuda/launch_items.cuh"
#include "backends/handed_rays.h"
#include "queues/reserved_queue.h"

namespace ambilux::detail {

constexpr uint32_t kHandBlock = 128;

/// Those of items `first`, first + 1, ..., as many as there is room for; a thread each.
template <class Stage>
__global__ void __launch_bounds__(kHandBlock)
    hand_over(const __grid_constant__ Stage stage, const Items all, const HandedRays handed, uint32_t first) {
    const uint32_t n = all.size(), k = blockIdx.x * kHandBlock + threadIdx.x, left = n > first ? n - first : 0;
    if (k == 0) *handed.count = min(left, handed.capacity);
    if (k >= min(left, handed.capacity)) return;
    const Items items = all.of(n);
    const uint32_t place = items.place(first + k);
    Ray ray;
    bool found = items.claim(place);
    if constexpr (Stage::kAnyHit) {
        typename Stage::Kept kept;
        found = found && stage.fetch(place, ray, kept);
    } else {
        found = found && stage.fetch(place, ray);
    }
    handed.hits[k].prim = found ? kNone : kNotHanded;
    if (!found) return;
    float4* const to = reinterpret_cast<float4*>(handed.rays + k);
    to[0] = make_float4(ray.o.x, ray.o.y, ray.o.z, ray.tmax);
    to[1] = make_float4(ray.d.x, ray.d.y, ray.d.z, __uint_as_float(ray.alpha_seed));
}

/// What has become of them. Shadow rays are fetched again for what they would bring: only valid ones were handed over,
/// so that nothing is counted twice.
template <class Stage>
__global__ void __launch_bounds__(kHandBlock)
    take_back(const __grid_constant__ Stage stage, const Items all, const HandedRays handed, uint32_t first) {
    constexpr bool reserves = requires { requires Stage::kReservesSlots; };
    const uint32_t n = all.size(), k = blockIdx.x * kHandBlock + threadIdx.x,
                   count = min(n > first ? n - first : 0, handed.capacity);
    if constexpr (reserves) ReservedSlots::of_block().open(count);
    const Hit hit = k < count ? handed.hits[k] : Hit{0.0f, 0.0f, 0.0f, kNotHanded};
    if (hit.prim != kNotHanded) {
        const uint32_t place = all.of(n).place(first + k);
        if constexpr (Stage::kAnyHit) {
            Ray ray;
            typename Stage::Kept kept;
            stage.fetch(place, ray, kept);
            stage.finish(place, kept, hit.prim != kNone);
        } else {
            stage.finish(place, hit);
        }
    }
    if constexpr (reserves) {
        __syncwarp();
        ReservedSlots::of_block().close();
    }
}

}  // namespace ambilux::detail
