// What all stages share. A stage is a struct: where its items come from (items()), where its results go, the record of
// what it did, and operator()(i) for one item. Its type is its identity; kName is what statistics call it. It drops and
// counts what is no radiance.
#pragma once

#include "items/candidate_items.h"
#include "items/subpath_items.h"
#include "queues/reserved_queue.h"
#include "queues/stage_record.h"
#include "queues/wave.h"
#include "stages/vertex_queues.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// True if `v` can be radiance. Anything else is counted in the record of the stage that made it, which drops it. With
/// a quick test before the exact one, kernels at their limit of registers spill.
AMBILUX_HD bool is_valid_radiance(Rgb v, StageRecord* record) {
    if (is_valid_radiance(v)) return true;
    uint64_t* kind = &record->negative;
    if (!is_finite(v)) kind = v.x != v.x || v.y != v.y || v.z != v.z ? &record->nan : &record->inf;
    add_count(kind, 1);
    return false;
}

/// True if `ray` can be traced; otherwise it is counted.
AMBILUX_HD bool is_valid_ray(Vec3f origin, Vec3f direction, StageRecord* record) {
    if (is_finite(origin) && is_finite(direction)) return true;
    add_count(&record->nan, 1);
    return false;
}

/// What a backend runs as part of the stage before it, without a queue in between.
struct Fusion {
    bool weigh = false;    ///< mis_weight, and accumulate
    bool connect = false;  ///< connect_emitter and connect_camera, in the stage that makes the vertex
    bool occlude =
        false;  ///< for bdpt connect_vertices, in the stage that makes the eye vertex, and shadow rays
                ///< whenever there are many: on a host, which goes through queues while they are in its cache
    bool generate = false;  ///< camera rays, in extend
};

/// `a` or `b`, of different types.
template <bool kFirst, class A, class B>
constexpr auto choose(const A& a, const B& b) {
    if constexpr (kFirst)
        return a;
    else
        return b;
}

}  // namespace ambilux
