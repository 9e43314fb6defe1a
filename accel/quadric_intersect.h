// Rays against spheres, disks and cylinders. Everything is relative to the shape's origin, so that its distance from
// the world's origin costs no precision, and origins that lie on the surface within rounding never hit it again at that
// point.
#pragma once

#include "scene/ray.h"
#include "scene/surface.h"

namespace ambilux {

/// Up to two crossings in ascending order, with the parameters that Hit describes.
struct QuadricCrossings {
    int count = 0;
    float t[2], u[2], v[2];
};

namespace detail {

AMBILUX_HD Vec3f quadric_origin(const Quadric& q) {
    return {q.to_world.m[0][3], q.to_world.m[1][3], q.to_world.m[2][3]};
}

/// Roots of a t² - 2 b t + c = 0 in ascending order, where `discriminant` = b² - a c >= 0 (Press et al., Numerical
/// Recipes, 5.6).
AMBILUX_HD void ordered_roots(float a, float b, float c, float discriminant, float& t0, float& t1) {
    const float q = b + copysignf(rounded_sqrt(discriminant), b);
    const float r0 = c == 0.0f ? 0.0f : rounded_divide(c, q), r1 = rounded_divide(q, a);
    t0 = min(r0, r1);
    t1 = max(r0, r1);
}

AMBILUX_HD QuadricCrossings sphere_crossings(const Quadric& q, Vec3f o, Vec3f d, float tmax) {
    QuadricCrossings hits;
    const Vec3f f = o - quadric_origin(q);
    const float r2 = q.radius * q.radius, f2 = dot(f, f), a = dot(d, d);
    const float b = -dot(f, d);
    float c = f2 - r2, discriminant;
    if (fabsf(c) <= gamma_bound(8) * (f2 + r2)) {
        // The origin is on the sphere: one root is 0, and the other follows without cancellation.
        c = 0.0f;
        discriminant = b * b;
    } else {
        // Haines et al. 2019, Ray Tracing Gems ch. 7, equation 5: from the point of the ray that is closest to the
        // centre.
        discriminant = a * (r2 - length_squared(f + d * rounded_divide(b, a)));
    }
    if (!(discriminant >= 0.0f)) return hits;
    float t[2];
    ordered_roots(a, b, c, discriminant, t[0], t[1]);
    for (int i = 0; i < 2; ++i) {
        if (!(t[i] > 0.0f && t[i] < tmax)) continue;
        const Vec3f n = q.to_local.vector(f + d * t[i]);
        const float l = length(n);
        if (!(l > 0.0f)) continue;
        const Vec2f e = octahedral_encode(n * (1.0f / l));
        hits.t[hits.count] = t[i];
        hits.u[hits.count] = e.x;
        hits.v[hits.count++] = e.y;
    }
    return hits;
}

AMBILUX_HD QuadricCrossings disk_crossings(const Quadric& q, Vec3f o, Vec3f d, float tmax) {
    QuadricCrossings hits;
    const Vec3f f = o - quadric_origin(q);
    const Vec3f row = {q.to_local.m[2][0], q.to_local.m[2][1], q.to_local.m[2][2]};
    const float z = dot(row, f);
    if (fabsf(z) <= gamma_bound(6) * dot(abs(row), abs(f))) return hits;  // the origin is on the disk
    const float t = rounded_divide(-z, dot(row, d));
    if (!(t > 0.0f && t < tmax)) return hits;
    const Vec3f p = q.to_local.vector(f + d * t);
    if (!(p.x * p.x + p.y * p.y <= 1.0f)) return hits;
    hits.count = 1;
    hits.t[0] = t;
    hits.u[0] = p.x;
    hits.v[0] = p.y;
    return hits;
}

AMBILUX_HD QuadricCrossings cylinder_crossings(const Quadric& q, Vec3f world_o, Vec3f world_d, float tmax) {
    QuadricCrossings hits;
    const Vec3f f = world_o - quadric_origin(q);
    const Vec3f o = q.to_local.vector(f), d = q.to_local.vector(world_d);
    const float a = d.x * d.x + d.y * d.y;
    if (!(a > 0.0f)) return hits;
    const float b = -(o.x * d.x + o.y * d.y);
    const float o2 = o.x * o.x + o.y * o.y;
    float c = o2 - 1.0f, discriminant;
    const Vec3f size = {
        fabsf(q.to_local.m[0][0] * f.x) + fabsf(q.to_local.m[0][1] * f.y) + fabsf(q.to_local.m[0][2] * f.z),
        fabsf(q.to_local.m[1][0] * f.x) + fabsf(q.to_local.m[1][1] * f.y) + fabsf(q.to_local.m[1][2] * f.z), 0.0f};
    if (fabsf(c) <=
        gamma_bound(6) * (o2 + 1.0f) + 2.0f * gamma_bound(5) * (fabsf(o.x) * size.x + fabsf(o.y) * size.y)) {
        c = 0.0f;
        discriminant = b * b;
    } else {
        const float s = rounded_divide(b, a), x = o.x + s * d.x, y = o.y + s * d.y;
        discriminant = a * (1.0f - (x * x + y * y));
    }
    if (!(discriminant >= 0.0f)) return hits;
    float t[2];
    ordered_roots(a, b, c, discriminant, t[0], t[1]);
    for (int i = 0; i < 2; ++i) {
        if (!(t[i] > 0.0f && t[i] < tmax)) continue;
        const float z = o.z + d.z * t[i];
        if (!(z >= 0.0f && z <= 1.0f)) continue;
        hits.t[hits.count] = t[i];
        hits.u[hits.count] = atan2f(o.y + d.y * t[i], o.x + d.x * t[i]);
        hits.v[hits.count++] = z;
    }
    return hits;
}

}  // namespace detail

/// Crossings of the ray o + t d, 0 < t < tmax, with an analytic shape. F says which types the scene has. They lie on
/// the shape, and lines are met or missed, within 16 roundings of its size plus the distance from the ray's origin to
/// its centre; of cylinders for rays across the axis by 1e-12 or more.
template <Features F>
AMBILUX_HD QuadricCrossings quadric_crossings(const Quadric& q, Vec3f o, Vec3f d, float tmax) {
    if (F.has(PrimitiveType::sphere) && q.type == PrimitiveType::sphere) return detail::sphere_crossings(q, o, d, tmax);
    if (F.has(PrimitiveType::disk) && q.type == PrimitiveType::disk) return detail::disk_crossings(q, o, d, tmax);
    if (F.has(PrimitiveType::cylinder) && q.type == PrimitiveType::cylinder)
        return detail::cylinder_crossings(q, o, d, tmax);
    return {};
}

}  // namespace ambilux
