// Rays that stages hand over to a tracer with launches of its own, and the hits that it hands back.
#pragma once

#include "queues/layout.h"
#include "scene/ray.h"

namespace ambilux {

/// Hit::prim of a place without a ray.
constexpr uint32_t kNotHanded = 0xfffffffeu;

/// A run of at most `capacity` rays. Longer queues are handed over run by run.
struct HandedRays {
    Ray* rays = nullptr;
    Hit* hits = nullptr;        ///< beside them; of shadow rays `prim` alone: kNone where one is free
    uint32_t* count = nullptr;  ///< of this run
    uint32_t capacity = 0;

    /// Nothing for a capacity of 0.
    static HandedRays lay_out(Layout& layout, uint32_t capacity) {
        if (capacity == 0) return {};
        return {layout.allocate<Ray>(capacity), layout.allocate<Hit>(capacity), layout.allocate<uint32_t>(1), capacity};
    }
};

}  // namespace ambilux
