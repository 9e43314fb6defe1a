// From the coordinates of a group to those of the scene.
#pragma once

#include "scene/view.h"

namespace ambilux {
namespace detail {

/// Product of the absolute values of the linear part with `v`, which is not negative.
AMBILUX_HD Vec3f absolute_vector(const Affine& a, Vec3f v) {
    return {fabsf(a.m[0][0]) * v.x + fabsf(a.m[0][1]) * v.y + fabsf(a.m[0][2]) * v.z,
            fabsf(a.m[1][0]) * v.x + fabsf(a.m[1][1]) * v.y + fabsf(a.m[1][2]) * v.z,
            fabsf(a.m[2][0]) * v.x + fabsf(a.m[2][1]) * v.y + fabsf(a.m[2][2]) * v.z};
}
AMBILUX_HD Vec3f absolute_point(const Affine& a, Vec3f p) {
    return absolute_vector(a, p) + Vec3f{fabsf(a.m[0][3]), fabsf(a.m[1][3]), fabsf(a.m[2][3])};
}

/// How far a point p of an instance may lie beside its surface: its vertices are rounded when they are moved into the
/// scene, and rays from near p when they are moved into the group (`local` is p there). Absolute values of both. The
/// inverse is off by a rounding of each entry; Embree makes one of its own, in several steps (PBRT 4th ed., 6.8.4).
AMBILUX_HD Vec3f placement_error(const Instance& instance, Vec3f p, Vec3f local) {
    return absolute_vector(instance.to_world, absolute_point(instance.to_group, p) * gamma_bound(12)) +
           absolute_point(instance.to_world, local) * gamma_bound(5);
}

}  // namespace detail

/// A vertex of the group where the instance has it.
AMBILUX_HD MeshVertex placed_vertex(const Instance& instance, const MeshVertex& vertex, bool has_normals) {
    MeshVertex v = vertex;
    v.p = instance.to_world.point(vertex.p);
    if (has_normals) v.n = normalize(instance.to_group.transposed_vector(vertex.n));
    return v;
}

}  // namespace ambilux
