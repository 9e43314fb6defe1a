// From a hit to a point on a surface.
#pragma once

#include "core/sampling.h"
#include "scene/placement.h"
#include "scene/ray.h"

namespace ambilux {

/// Point on a surface, world space.
struct SurfacePoint {
    Vec3f p;
    /// A box of this half size around p meets the surface: bound of the error of each coordinate of p but for steps
    /// along the surface, which 1 - b1 - b2 adds on triangles (2^-23 of the first corner).
    Vec3f p_error;
    Vec3f ng;  ///< unit geometric normal; on triangles with vertex normals it lies on their side
    Vec3f ns;  ///< unit shading normal (interpolated), dot(ns, ng) may be negative only for absurd vertex normals
    Vec3f dpdu, dpdv;  ///< partial derivatives of p by uv; zero or arbitrary tangents where uv do not define them
    Vec2f uv;          ///< texture coordinates as in Mitsuba: triangles without uvs use barycentrics (b1,b2)
    uint32_t prim, shape;
    bool framed;  ///< dpdu is already the s axis of frame_from_normal_tangent(ns, dpdu)
};

/// Octahedral map of a unit vector to [-1,1]² (Cigolle et al. 2014, "A Survey of Efficient Representations for
/// Independent Unit Vectors"). There and back a direction moves by 5e-7 at most.
AMBILUX_HD Vec2f octahedral_encode(Vec3f n) {
    const float inv = 1.0f / (fabsf(n.x) + fabsf(n.y) + fabsf(n.z));
    const float x = n.x * inv, y = n.y * inv;
    if (n.z >= 0.0f) return {x, y};
    return {copysignf(1.0f - fabsf(y), x), copysignf(1.0f - fabsf(x), y)};
}

/// The point of the octahedron that octahedral_encode maps to `e`: a vector of that direction, between 1/sqrt(3) and 1
/// long.
AMBILUX_HD Vec3f octahedral_direction(Vec2f e) {
    const float z = 1.0f - fabsf(e.x) - fabsf(e.y);
    return z >= 0.0f ? Vec3f{e.x, e.y, z}
                     : Vec3f{copysignf(1.0f - fabsf(e.y), e.x), copysignf(1.0f - fabsf(e.x), e.y), z};
}

/// Inverse of octahedral_encode; the result is unit within rounding.
AMBILUX_HD Vec3f octahedral_decode(Vec2f e) { return normalize(octahedral_direction(e)); }

namespace detail {

/// a·b - c·d with one rounding error at most (Kahan; Jeannerod et al. 2013). Its sign is exact, and the same on host
/// and device whatever a compiler fuses.
AMBILUX_HD float difference_of_products(float a, float b, float c, float d) {
    const float cd = c * d;
    const float difference = fmaf(a, b, -cd);
    const float error = fmaf(-c, d, cd);
    return difference + error;
}

AMBILUX_HD Vec3f accurate_cross(Vec3f a, Vec3f b) {
    return {difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
            difference_of_products(a.x, b.y, a.y, b.x)};
}

/// Unit normal of a triangle, within 6 roundings of that of the edges; any unit vector across the longer edge if the
/// sine between them times their ratio is below 2^-48. Scaled first, so that small triangles do not underflow.
AMBILUX_HD Vec3f triangle_normal(Vec3f e1, Vec3f e2) {
    const float scale = max(max_component(abs(e1)), max_component(abs(e2)));
    if (!(scale > 0.0f)) return {0.0f, 0.0f, 1.0f};
    // A power of two near 1/scale, so that nothing is rounded.
    constexpr FloatBits kMost = 2 * kExponentBias - 2;
    const FloatBits exponent = float_bits(scale) >> kFractionBits;
    const float inv = bits_float((kMost + 1 - (exponent < kMost ? exponent : kMost)) << kFractionBits);
    const Vec3f a = e1 * inv, b = e2 * inv, n = accurate_cross(a, b);
    const float l2 = length_squared(n);
    if (l2 > 0x1p-100f) return n * inverse_sqrt(l2);
    // Collinear: orthogonal to the longer edge at least.
    return frame_from_normal(normalize(length_squared(a) > length_squared(b) ? a : b)).s;
}

AMBILUX_HD void any_tangents(SurfacePoint& s) {
    const Frame frame = frame_from_normal(s.ng);
    s.dpdu = frame.s;
    s.dpdv = frame.t;
}

/// Where barycentrics (b1,b2) lie on a triangle, as SurfacePoint::p and p_error.
AMBILUX_HD void place_on_triangle(SurfacePoint& s, Vec3f p0, Vec3f p1, Vec3f p2, float b1, float b2) {
    const Vec3f q0 = p0 * (1.0f - b1 - b2), q1 = p1 * b1, q2 = p2 * b2;
    s.p = q0 + q1 + q2;
    s.p_error = (abs(q0) + abs(q1) + abs(q2)) * gamma_bound(7);  // PBRT 4th ed., 6.8.5
}

/// Unit normal between those of three vertices, or `ng` where there is none.
AMBILUX_HD Vec3f interpolated_normal(const MeshVertex& a, const MeshVertex& b, const MeshVertex& c, float b1, float b2,
                                     Vec3f ng) {
    const Vec3f n = a.n * (1.0f - b1 - b2) + b.n * b1 + c.n * b2;
    const float l2 = length_squared(n);
    return l2 > 1e-20f ? n * inverse_sqrt(l2) : ng;
}

AMBILUX_HD Vec2f interpolated_uv(Vec2f t0, Vec2f t1, Vec2f t2, float b1, float b2) {
    return t0 * (1.0f - b1 - b2) + t1 * b1 + t2 * b2;
}

/// Point of a triangle at barycentrics (b1,b2) of its second and third vertex, but for what names it. `ng` is within 6
/// roundings of the triangle's, and 3 over the sine between its edges. `mirrored`: its vertices go round the other way.
AMBILUX_HD SurfacePoint triangle_point(const MeshVertex& a, const MeshVertex& b, const MeshVertex& c, uint32_t flags,
                                       float b1, float b2, bool mirrored = false) {
    const Vec3f p0 = a.p, p1 = b.p, p2 = c.p;
    SurfacePoint s;
    s.framed = false;
    place_on_triangle(s, p0, p1, p2, b1, b2);
    const Vec3f e1 = p1 - p0, e2 = p2 - p0;
    s.ng = mirrored ? triangle_normal(e2, e1) : triangle_normal(e1, e2);
    s.ns = flags & kShapeHasNormals ? interpolated_normal(a, b, c, b1, b2, s.ng) : s.ng;
    if (flags & kShapeHasUvs) {
        const Vec2f t0 = a.uv(), t1 = b.uv(), t2 = c.uv();
        s.uv = interpolated_uv(t0, t1, t2, b1, b2);
        const Vec2f d1 = t1 - t0, d2 = t2 - t0;
        const float det = difference_of_products(d1.x, d2.y, d1.y, d2.x);
        if (det == 0.0f) {
            any_tangents(s);
        } else {
            const float inv = 1.0f / det;
            s.dpdu = (e1 * d2.y - e2 * d1.y) * inv;
            s.dpdv = (e2 * d1.x - e1 * d2.x) * inv;
            if (!is_finite(s.dpdu) || !is_finite(s.dpdv)) any_tangents(s);
        }
    } else {
        s.uv = {b1, b2};
        s.dpdu = e1;
        s.dpdv = e2;
    }
    return s;
}

/// Point of triangle `prim`, one that is stored.
AMBILUX_HD SurfacePoint triangle_surface_at(const SceneView& scene, uint32_t prim, float b1, float b2) {
    const Triangle tri = scene.triangles[prim];
    SurfacePoint s = triangle_point(scene.vertices[tri.v0], scene.vertices[tri.v1], scene.vertices[tri.v2],
                                    scene.shapes[tri.shape].flags, b1, b2);
    s.prim = prim;
    s.shape = tri.shape;
    return s;
}

/// The same from its Face, with dpdu alone of the derivatives.
AMBILUX_HD SurfacePoint face_surface_at(const SceneView& scene, uint32_t prim, float b1, float b2) {
    const Face& face = scene.faces[prim];
    SurfacePoint s;
    place_on_triangle(s, face.p0, face.p1, face.p2, b1, b2);
    s.ng = s.ns = face.ng;
    s.dpdu = face.dpdu;
    s.uv = {b1, b2};
    s.prim = prim;
    s.shape = face.shape;
    const uint32_t flags = scene.shapes[face.shape].flags;
    s.framed = !(flags & kShapeHasNormals);
    if (flags & (kShapeHasNormals | kShapeHasUvs)) {
        const Triangle tri = scene.triangles[prim];
        const MeshVertex &a = scene.vertices[tri.v0], &b = scene.vertices[tri.v1], &c = scene.vertices[tri.v2];
        if (flags & kShapeHasNormals) s.ns = interpolated_normal(a, b, c, b1, b2, face.ng);
        if (flags & kShapeHasUvs) s.uv = interpolated_uv(a.uv(), b.uv(), c.uv(), b1, b2);
    }
    return s;
}

/// Point of a triangle of an instance, from its vertices in the scene: what a copy of the group would give.
AMBILUX_HD SurfacePoint instanced_surface_at(const SceneView& scene, uint32_t prim, float b1, float b2) {
    const Instance& instance = scene.instance_of(prim);
    const Triangle tri = scene.triangles[instance.triangle_of(prim)];
    const uint32_t flags = scene.shapes[tri.shape].flags;
    const bool normals = flags & kShapeHasNormals;
    const MeshVertex a = placed_vertex(instance, scene.vertices[tri.v0], normals),
                     b = placed_vertex(instance, scene.vertices[tri.v1], normals),
                     c = placed_vertex(instance, scene.vertices[tri.v2], normals);
    SurfacePoint s = triangle_point(a, b, c, flags, b1, b2, instance.mirrored);
    // Scales that differ may leave it on the other side of the vertex normals.
    if (normals && dot(s.ng, a.n + b.n + c.n) < 0.0f) s.ng = -s.ng;
    s.p_error = s.p_error + placement_error(instance, abs(s.p), abs(instance.to_group.point(s.p)));
    s.prim = prim;
    s.shape = tri.shape;
    return s;
}

/// Bound of |q.to_world.point(local)'s error| when each coordinate of `local` is off by at most `relative` of itself
/// (PBRT 4th ed., equation 6.30, with the terms of the matrix kept apart from the translation, which is added last).
AMBILUX_HD Vec3f quadric_error(const Quadric& q, Vec3f local, float relative) {
    Vec3f e;
    for (int i = 0; i < 3; ++i) {
        const float linear = fabsf(q.to_world.m[i][0] * local.x) + fabsf(q.to_world.m[i][1] * local.y) +
                             fabsf(q.to_world.m[i][2] * local.z);
        e[i] = (gamma_bound(4) + relative) * linear + gamma_bound(2) * fabsf(q.to_world.m[i][3]);
    }
    return e;
}

AMBILUX_HD SurfacePoint quadric_surface_at(const SceneView& scene, uint32_t prim, float u, float v) {
    const Quadric& q = scene.quadric(prim);
    SurfacePoint s;
    s.prim = prim;
    s.shape = q.shape;
    s.framed = false;
    Vec3f local, normal;
    if (q.type == PrimitiveType::sphere) {
        local = normal = octahedral_decode({u, v});
        const float r = sqrtf(local.x * local.x + local.y * local.y);
        float phi = atan2f(local.y, local.x);
        if (phi < 0.0f) phi += 2.0f * kPi;
        const float theta = atan2f(r, local.z);
        s.uv = {phi * kInv2Pi, theta * kInvPi};
        const float cos_phi = r > 0.0f ? local.x / r : 1.0f, sin_phi = r > 0.0f ? local.y / r : 0.0f;
        s.dpdu = q.to_world.vector(Vec3f{-local.y, local.x, 0.0f} * (2.0f * kPi));
        s.dpdv = q.to_world.vector(Vec3f{local.z * cos_phi, local.z * sin_phi, -r} * kPi);
        // Unit within rounding (7, where roots and quotients are not correctly rounded), and to_world's scale stands
        // for `radius`, each rounded on its own.
        s.p_error = quadric_error(q, local, gamma_bound(11));
    } else if (q.type == PrimitiveType::disk) {
        local = {u, v, 0.0f};
        normal = {0.0f, 0.0f, 1.0f};
        const float r = sqrtf(u * u + v * v);
        const float phi = atan2f(v, u) * kInv2Pi;
        s.uv = {r, phi < 0.0f ? phi + 1.0f : phi};
        const float cos_phi = r > 0.0f ? u / r : 1.0f, sin_phi = r > 0.0f ? v / r : 0.0f;
        s.dpdu = q.to_world.vector({cos_phi, sin_phi, 0.0f});
        s.dpdv = q.to_world.vector(Vec3f{-sin_phi, cos_phi, 0.0f} * (2.0f * kPi * r));
        s.p_error = quadric_error(
            q, local, gamma_bound(5));  // to_local, which decides what is on the plane, is an inverse within rounding
    } else {
        normal = {cosf(u), sinf(u), 0.0f};
        local = {normal.x, normal.y, v};
        s.uv = {(u < 0.0f ? u + 2.0f * kPi : u) * kInv2Pi, v};
        s.dpdu = q.to_world.vector(Vec3f{-normal.y, normal.x, 0.0f} * (2.0f * kPi));
        s.dpdv = q.to_world.vector({0.0f, 0.0f, 1.0f});
        // sinf and cosf: 2 ulp on a device (CUDA programming guide, appendix on mathematical functions).
        s.p_error = quadric_error(q, local, gamma_bound(8));
    }
    s.p = q.to_world.point(local);
    s.ng = normalize(q.to_local.transposed_vector(normal));
    if (q.flip) s.ng = -s.ng;
    s.ns = s.ng;
    return s;
}

}  // namespace detail

/// The surface point that (prim,u,v) of a Hit names (scene/ray.h); the same for points that emitters sample. World
/// space.
template <Features F>
AMBILUX_HD SurfacePoint surface_at(const SceneView& scene, uint32_t prim, float u, float v) {
    if constexpr (F.instances)
        if (scene.is_instanced(prim)) return detail::instanced_surface_at(scene, prim, u, v);
    if constexpr (F.has_quadrics()) {
        if constexpr (!F.has(PrimitiveType::triangle)) return detail::quadric_surface_at(scene, prim, u, v);
        if (!scene.is_triangle(prim)) return detail::quadric_surface_at(scene, prim, u, v);
    }
#if !defined(__CUDA_ARCH__)
    if constexpr (!F.bumps)
        if (scene.faces) return detail::face_surface_at(scene, prim, u, v);
#endif
    return detail::triangle_surface_at(scene, prim, u, v);
}

}  // namespace ambilux
