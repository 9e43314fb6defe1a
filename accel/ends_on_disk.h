// Shadow rays that end on a disk.
#pragma once

#include "scene/ray.h"
#include "scene/view.h"

namespace ambilux {

/// True if the ray ends on the plane of the disk, as far as a crossing of it is known. Where the disk is seen nearly
/// edge-on, that is more along the ray than shadow rays are short of their ends, in any precision, and no such crossing
/// is a blocker. Rays without an end are none of these.
AMBILUX_HD bool ends_on_disk(const Quadric& q, const Ray& ray) {
    if (q.type != PrimitiveType::disk) return false;
    const Vec3f row = {q.to_local.m[2][0], q.to_local.m[2][1], q.to_local.m[2][2]},
                from = ray.o - Vec3f{q.to_world.m[0][3], q.to_world.m[1][3], q.to_world.m[2][3]},
                way = ray.d * ray.tmax;
    const float bound = gamma_bound(8) * dot(abs(row), abs(from) + abs(way));
    return bound < kInfinity && fabsf(dot(row, from + way)) <= bound;
}

}  // namespace ambilux
