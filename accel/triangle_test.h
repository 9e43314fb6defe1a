// Watertight ray-triangle test.
#pragma once

#include "accel/reciprocal.h"
#include "scene/surface.h"

namespace ambilux {

/// Two rows of the shear that maps a ray to the z axis: row·(p - o) are the coordinates of p seen along the ray (Woop,
/// Benthin, Wald 2013, section 3.1; the permutation of axes is folded into the rows, whose entries are 1, 0 and the
/// shear itself).
struct RayShear {
    Vec3f x, y;
};

AMBILUX_HD RayShear make_ray_shear(Vec3f d) {
    const Vec3f m = abs(d);
    const bool x = m.x > m.y && m.x > m.z, y = !x && m.y > m.z, z = !x && !y;
    // Selected rather than branched to: lanes of a warp need all three.
    const float r = -ordinary_reciprocal(x ? d.x : y ? d.y : d.z);
    const float first = (x ? d.y : y ? d.z : d.x) * r, second = (x ? d.z : y ? d.x : d.y) * r;
    return {{x ? first : float(z), y ? first : float(x), z ? first : float(y)},
            {x ? second : float(y), y ? second : float(z), z ? second : float(x)}};
}

/// Crossing of a ray and a triangle: distance and barycentrics of v1 and v2.
struct TriangleCrossing {
    float t, u, v;
};

/// Height of the origin over the plane of triangle (v0,v1,v2) times |n| for a = v0 - o, zero if it is no more than the
/// rounding of its distance; `n` is the normal, not unit.
AMBILUX_HD float height_over_plane(Vec3f a, Vec3f n) {
    const float height = dot(a, n);
    return fabsf(height) > gamma_bound(6) * dot(abs(a), abs(n)) ? height : 0.0f;
}

/// Where a ray is to the edges of a triangle.
struct TriangleEdges {
    float v, w, det;
    bool inside;  ///< or on an edge, and the triangle is not seen from its side

    AMBILUX_HD TriangleCrossing crossing(float t) const {
        const float r = rounded_divide(1.0f, det);
        return {t, v * r, w * r};
    }
};

AMBILUX_HD TriangleEdges triangle_edges(Vec3f o, const RayShear& shear, Vec3f v0, Vec3f v1, Vec3f v2) {
    const Vec3f a = v0 - o, b = v1 - o, c = v2 - o;
    const float ax = dot(a, shear.x), ay = dot(a, shear.y);
    const float bx = dot(b, shear.x), by = dot(b, shear.y);
    const float cx = dot(c, shear.x), cy = dot(c, shear.y);
    const float u = detail::difference_of_products(cx, by, cy, bx);
    const float v = detail::difference_of_products(ax, cy, ay, cx);
    const float w = detail::difference_of_products(bx, ay, by, ax);
    const float det = u + v + w;
    // The determinant must have a reciprocal.
    return {v, w, det, !(((min(u, min(v, w)) < 0.0f) & (max(u, max(v, w)) > 0.0f)) | !(fabsf(det) >= 0x1p-126f))};
}

/// True if the ray o + t d crosses triangle (v0,v1,v2) at 0 < t < tmax. A ray through an edge or a vertex meets at
/// least one of the triangles that share it: each edge function has the exact sign for its projected end points, and
/// zero counts as inside. An origin that lies on the triangle's plane within the rounding of the distance does not meet
/// it. `normal()`: accurate_cross(v1 - v0, v2 - v0). Errors (tests/accel/test_intersection_bounds.cpp): 9 roundings of
/// the height over the plane and of t times the slope, as sums of magnitudes; 10 of the products of an edge function.
template <class Normal>
AMBILUX_HD bool intersect_triangle(Vec3f o, Vec3f d, const RayShear& shear, Vec3f v0, Vec3f v1, Vec3f v2, float tmax,
                                   TriangleCrossing& hit, Normal normal) {
    const Vec3f a = v0 - o;
    const TriangleEdges edges = triangle_edges(o, shear, v0, v1, v2);
    // One branch for both: lanes of a warp rarely agree about any of them.
    if (!edges.inside) return false;
    // Distance along the ray from the plane. Unlike the interpolated depth it is exactly zero for origins on an
    // axis-aligned triangle.
    const Vec3f n = normal();
    const float height = height_over_plane(a, n);
    const float t = rounded_divide(height, dot(d, n));  // not a number for two zeros
    if (!(t > 0.0f && t < tmax)) return false;
    hit = edges.crossing(t);
    return true;
}

AMBILUX_HD bool intersect_triangle(Vec3f o, Vec3f d, const RayShear& shear, Vec3f v0, Vec3f v1, Vec3f v2, float tmax,
                                   TriangleCrossing& hit) {
    return intersect_triangle(o, d, shear, v0, v1, v2, tmax, hit,
                              [&] { return detail::accurate_cross(v1 - v0, v2 - v0); });
}

}  // namespace ambilux
