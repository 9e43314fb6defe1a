// What stages drop and count because it is no radiance, or no ray.
#pragma once

#include "core/atomic.h"
#include "queues/stage_record.h"
#include "transport/subpath/subpath.h"

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

}  // namespace ambilux
