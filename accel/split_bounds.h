// Parts of triangles.
#pragma once

#include "scene/primitive_bounds.h"

namespace ambilux {

/// Boxes of the parts of triangle `prim` in `within` on either side of the plane x[axis] = position, which meets it.
/// Rounded outwards.
AMBILUX_HD void split_triangle_bounds(const SceneView& scene, uint32_t prim, const Bounds3f& within, int axis,
                                      float position, Bounds3f& left, Bounds3f& right) {
    const Triangle tri = scene.triangles[prim];
    const Vec3f v[3] = {scene.vertices[tri.v0].p, scene.vertices[tri.v1].p, scene.vertices[tri.v2].p};
    left = right = {};
    for (int i = 0; i < 3; ++i) {
        const Vec3f a = v[i], b = v[(i + 1) % 3];
        if (a[axis] <= position) left.extend(a);
        if (a[axis] >= position) right.extend(a);
        if ((a[axis] < position && b[axis] > position) || (a[axis] > position && b[axis] < position)) {
            const Vec3f c = a + (b - a) * rounded_divide(position - a[axis], b[axis] - a[axis]);
            const Vec3f pad = max(abs(a), abs(b)) * gamma_bound(6);
            left.extend(c - pad), left.extend(c + pad);
            right.extend(c - pad), right.extend(c + pad);
        }
    }
    left.upper[axis] = min(left.upper[axis], position);
    right.lower[axis] = max(right.lower[axis], position);
    left.lower = max(left.lower, within.lower), left.upper = min(left.upper, within.upper);
    right.lower = max(right.lower, within.lower), right.upper = min(right.upper, within.upper);
    // A sliver that rounding leaves without a box on one side: the box alone is cut.
    if (left.empty()) left = within, left.upper[axis] = min(position, within.upper[axis]);
    if (right.empty()) right = within, right.lower[axis] = max(position, within.lower[axis]);
}

}  // namespace ambilux
