// World-space boxes of primitives, rounded outwards.
#pragma once

#include "scene/placement.h"

namespace ambilux {

struct Bounds3f {
    Vec3f lower = splat(kInfinity), upper = splat(-kInfinity);

    AMBILUX_HD void extend(Vec3f p) {
        lower = min(lower, p);
        upper = max(upper, p);
    }
    AMBILUX_HD void extend(const Bounds3f& b) {
        lower = min(lower, b.lower);
        upper = max(upper, b.upper);
    }
    AMBILUX_HD bool empty() const { return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z); }
    /// Half the surface area.
    AMBILUX_HD float half_area() const {
        if (empty()) return 0.0f;
        const Vec3f e = upper - lower;
        return e.x * e.y + e.y * e.z + e.z * e.x;
    }
};

/// Box of an analytic shape. Sphere, disk and cylinder caps are images of the unit sphere or disk under an affine map:
/// along each axis they reach as far as the length of the matrix row says.
AMBILUX_HD Bounds3f quadric_bounds(const Quadric& q) {
    Bounds3f b;
    for (int i = 0; i < 3; ++i) {
        const float x = q.to_world.m[i][0], y = q.to_world.m[i][1], z = q.to_world.m[i][2], c = q.to_world.m[i][3];
        float lo, hi;
        if (q.type == PrimitiveType::sphere) {
            const float r = rounded_sqrt(x * x + y * y + z * z);
            lo = c - r, hi = c + r;
        } else {
            const float r = rounded_sqrt(x * x + y * y);
            const float end = q.type == PrimitiveType::cylinder ? z : 0.0f;
            lo = c + min(0.0f, end) - r, hi = c + max(0.0f, end) + r;
        }
        const float pad = gamma_bound(8) * (fabsf(c) + fabsf(x) + fabsf(y) + fabsf(z));
        b.lower[i] = lo - pad;
        b.upper[i] = hi + pad;
    }
    return b;
}

AMBILUX_HD Bounds3f triangle_bounds(const SceneView& scene, uint32_t prim) {
    const Triangle tri = scene.triangles[prim];
    Bounds3f b;
    b.extend(scene.vertices[tri.v0].p);
    b.extend(scene.vertices[tri.v1].p);
    b.extend(scene.vertices[tri.v2].p);
    return b;
}

/// Box of what is stored of primitive `prim`; empty if some of it is not finite.
AMBILUX_HD Bounds3f finite_bounds(const SceneView& scene, uint32_t prim) {
    const Bounds3f b = scene.is_triangle(prim) ? triangle_bounds(scene, prim) : quadric_bounds(scene.quadric(prim));
    bool finite = is_finite(b.lower) && is_finite(b.upper);
    if (scene.is_triangle(prim)) {
        // min and max skip NaN, so vertices are looked at themselves.
        const Triangle t = scene.triangles[prim];
        finite =
            is_finite(scene.vertices[t.v0].p) && is_finite(scene.vertices[t.v1].p) && is_finite(scene.vertices[t.v2].p);
    }
    return finite ? b : Bounds3f{};
}

/// Box of an instance, with what rounding does to rays that are moved into its group.
AMBILUX_HD Bounds3f instance_bounds(const SceneView& scene, const Instance& instance) {
    const Group& g = scene.groups[instance.group];
    Bounds3f b;
    if (!g.triangle_count) return b;
    for (uint32_t corner = 0; corner < 8; ++corner)
        b.extend(instance.to_world.point({corner & 1 ? g.upper.x : g.lower.x, corner & 2 ? g.upper.y : g.lower.y,
                                          corner & 4 ? g.upper.z : g.lower.z}));
    const Vec3f most = max(abs(b.lower), abs(b.upper));
    const Vec3f pad = detail::placement_error(instance, most, max(abs(g.lower), abs(g.upper)));
    b.lower = b.lower - pad, b.upper = b.upper + pad;
    return b;
}

}  // namespace ambilux
