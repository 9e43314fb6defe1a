// Area emitter: every point of its shape radiates `radiance` into the hemisphere around the geometric normal. A mask
// takes nothing from it, as in Mitsuba: rays that meet a surface of opacity a with probability a bring 1/a of its
// light. Where the opacity is 0 there is no surface and no light.
#pragma once

#include "transport/emitter/sample.h"
#include "transport/opacity.h"

namespace ambilux {

/// Chance that a ray which crosses the area emitter at texture coordinates `uv` meets it.
template <Features F>
AMBILUX_HD float area_opacity(const SceneView& view, const Emitter& emitter, Vec2f uv) {
    if constexpr (F.opacity) return surface_opacity<F>(view, view.materials[view.shapes[emitter.shape].material], uv);
    return 1.0f;
}

/// Radiance of the emitter at a point with texture coordinates `uv` and opacity `opacity`.
template <Features F>
AMBILUX_HD Rgb area_radiance(const SceneView& view, const Emitter& emitter, Vec2f uv, float opacity) {
    if (F.opacity && !(opacity > 0.0f)) return {0, 0, 0};
    return eval_rgb<F>(view, emitter.radiance, uv);
}

/// Radiance that a ray meets at `point` of the area emitter, looking back along unit `wo`, over its chance to meet it
/// there; zero behind the geometric normal (two-sided light needs two shapes, as in Mitsuba).
template <Features F>
AMBILUX_HD Rgb area_hit_radiance(const SceneView& view, const Emitter& emitter, const SurfacePoint& point, Vec3f wo) {
    if (!(dot(point.ng, wo) > 0.0f)) return {0, 0, 0};
    const float opacity = area_opacity<F>(view, emitter, point.uv);
    const Rgb radiance = area_radiance<F>(view, emitter, point.uv, opacity);
    return F.opacity ? radiance * (1.0f / hit_chance(opacity)) : radiance;
}

/// Density per area with which area_sample_point picks a point of primitive `prim`.
AMBILUX_HD float area_pdf_position(const SceneView& view, const Emitter& emitter, uint32_t prim) {
    const Shape& shape = view.shapes[emitter.shape];
    if (emitter.area_cdf == kNone) return 1.0f / shape.area;
    return view.tables[emitter.area_cdf + shape.primitive_count + 1 + (prim - shape.first_primitive)];
}

/// The primitive of the emitter that `u` in [0,1) chooses by area.
AMBILUX_HD uint32_t area_pick_primitive(const SceneView& view, const Emitter& emitter, float u) {
    const Shape& shape = view.shapes[emitter.shape];
    uint32_t prim = shape.first_primitive;
    if (emitter.area_cdf != kNone) prim += sample_cdf(view.tables + emitter.area_cdf, shape.primitive_count, u);
    return prim;
}

/// Uniform point of the emitter's shape: `u` places it on a primitive that `u_primitive` chose by area.
template <Features F>
AMBILUX_HD SurfacePoint area_sample_point(const SceneView& view, const Emitter& emitter, float u_primitive, Vec2f u) {
    const uint32_t prim = area_pick_primitive(view, emitter, u_primitive);
    Vec2f c;
    if (!F.has_quadrics() || view.is_triangle(prim)) {
        c = square_to_triangle(u);
    } else {
        const PrimitiveType type = view.quadric(prim).type;
        if (type == PrimitiveType::sphere)
            c = octahedral_encode(square_to_sphere(u));
        else if (type == PrimitiveType::disk)
            c = square_to_disk(u);
        else
            c = {kPi * (2.0f * u.x - 1.0f), u.y};
    }
    return surface_at<F>(view, prim, c.x, c.y);
}

/// The cone in which a sphere is seen from outside.
struct SphereCone {
    Vec3f axis;               ///< unit, from the reference to the centre
    float distance;           ///< to the centre
    float sin2_max;           ///< of the half angle
    float one_minus_cos_max;  ///< without cancellation for small and far spheres
    bool outside;  ///< false: the cone is no help: the reference is on or inside the sphere, or that radiates inwards;
                   ///< the rest is not set
};

AMBILUX_HD Vec3f quadric_center(const Quadric& q) {
    return {q.to_world.m[0][3], q.to_world.m[1][3], q.to_world.m[2][3]};
}

AMBILUX_HD SphereCone sphere_cone(const Quadric& sphere, Vec3f reference_p) {
    const Vec3f to_center = quadric_center(sphere) - reference_p;
    const float d2 = length_squared(to_center), r2 = sphere.radius * sphere.radius;
    SphereCone cone{};
    cone.distance = sqrtf(d2);
    // Points of a sphere that radiates inwards are outside of it as often as rounding will have it; they see its light
    // all the same.
    cone.outside = !sphere.flip && cone.distance > sphere.radius;
    if (!cone.outside) return cone;
    cone.axis = to_center * (1.0f / cone.distance);
    cone.sin2_max = r2 / d2;
    cone.one_minus_cos_max = cone.sin2_max / (1.0f + safe_sqrt(1.0f - cone.sin2_max));
    return cone;
}

/// Direct light from a sphere seen from outside: a direction uniform in its cone (PBRT 4th ed., 6.2.4). Distance and
/// angle at the centre come from d - r and not from differences of squares, so that they stay right next to the surface
/// and far away.
template <Features F>
AMBILUX_HD bool area_sample_sphere(const SceneView& view, const Emitter& emitter, uint32_t prim, const SphereCone& cone,
                                   Vec2f u, EmitterSample& s) {
    const Quadric& sphere = view.quadric(prim);
    s.prim = prim;
    const Vec3f local = square_to_cone(u, cone.one_minus_cos_max);
    const Frame frame = frame_from_normal(cone.axis);
    const float sin2 = local.x * local.x + local.y * local.y, sin_theta = sqrtf(sin2), cos_theta = local.z;
    const float r = sphere.radius, d = cone.distance;
    s.distance = (d - r) * (d + r) / (d * cos_theta + r * safe_sqrt(1.0f - sin2 / cone.sin2_max));
    const float sin_alpha = s.distance * sin_theta / r, cos_alpha = (d - s.distance * cos_theta) / r;
    const Vec3f side = sin_theta > 0.0f ? (frame.s * local.x + frame.t * local.y) * (1.0f / sin_theta) : frame.s;
    s.ng = normalize(side * sin_alpha - cone.axis * cos_alpha);
    const Vec3f center = quadric_center(sphere);
    s.p = center + s.ng * r;
    s.p_error = (abs(center) + splat(r)) * gamma_bound(8);
    s.wi = frame.to_world(local);
    s.pdf_sa = emitter.pick_probability * kInv2Pi / cone.one_minus_cos_max;
    Vec2f uv = {0.0f, 0.0f};
    if (F.textures && (emitter.radiance.texture >= 0 || F.opacity)) {
        const Vec2f c = octahedral_encode(normalize(sphere.to_local.vector(s.ng)));
        uv = surface_at<F>(view, prim, c.x, c.y).uv;
    }
    s.opacity = area_opacity<F>(view, emitter, uv);
    s.radiance = area_radiance<F>(view, emitter, uv, s.opacity);
    return s.distance > 0.0f;
}

struct LightGeometry {
    float distance2;
    float cosine;  ///< at the light; not positive where its light does not arrive
};

/// Place, distance and direction of `s` for light that leaves `point` for `reference_p`.
AMBILUX_HD LightGeometry light_from_point(const SurfacePoint& point, Vec3f reference_p, EmitterSample& s) {
    const Vec3f to_light = point.p - reference_p;
    const float d2 = length_squared(to_light);
    if (!(d2 > 0.0f)) return {d2, 0.0f};
    s.p = point.p;
    s.p_error = point.p_error;
    s.ng = point.ng;
    s.distance = sqrtf(d2);
    s.wi = to_light * (1.0f / s.distance);
    return {d2, -dot(point.ng, s.wi)};
}

/// Density per solid angle of a place that was chosen with `pdf_area` per area.
AMBILUX_HD float pdf_from_area(float pdf_area, const LightGeometry& light) {
    return pdf_area * light.distance2 / light.cosine;
}

/// Direct light from an area emitter at `reference_p`; false when the sample carries none. Sphere from outside: by
/// solid angle; everything else: by area.
template <Features F>
AMBILUX_HD bool area_sample_direct(const SceneView& view, const Emitter& emitter, Vec3f reference_p, float u_primitive,
                                   Vec2f u, EmitterSample& s) {
    s.delta = false;
    if constexpr (F.has(PrimitiveType::sphere)) {
        const uint32_t prim = view.shapes[emitter.shape].first_primitive;
        if (!view.is_triangle(prim) && view.quadric(prim).type == PrimitiveType::sphere) {
            const SphereCone cone = sphere_cone(view.quadric(prim), reference_p);
            if (cone.outside) return area_sample_sphere<F>(view, emitter, prim, cone, u, s);
        }
    }
    const SurfacePoint point = area_sample_point<F>(view, emitter, u_primitive, u);
    const LightGeometry light = light_from_point(point, reference_p, s);
    if (!(light.cosine > 0.0f)) return false;
    s.prim = point.prim;
    s.opacity = area_opacity<F>(view, emitter, point.uv);
    s.radiance = area_radiance<F>(view, emitter, point.uv, s.opacity);
    s.pdf_sa = pdf_from_area(emitter.pick_probability * area_pdf_position(view, emitter, point.prim), light);
    return true;
}

/// Density per solid angle, pick probability included, with which area_sample_direct returns direction `wi` when that
/// meets the emitter at `hit`; zero at the back, which it never returns.
template <Features F>
AMBILUX_HD float area_pdf_direct(const SceneView& view, const Emitter& emitter, Vec3f reference_p, Vec3f wi,
                                 const SurfacePoint& hit) {
    const float cos_light = -dot(hit.ng, wi);
    if (!(cos_light > 0.0f)) return 0.0f;
    if constexpr (F.has(PrimitiveType::sphere)) {
        if (!view.is_triangle(hit.prim) && view.quadric(hit.prim).type == PrimitiveType::sphere) {
            const Quadric& sphere = view.quadric(hit.prim);
            const SphereCone cone = sphere_cone(sphere, reference_p);
            if (cone.outside) return emitter.pick_probability * kInv2Pi / cone.one_minus_cos_max;
        }
    }
    return emitter.pick_probability * area_pdf_position(view, emitter, hit.prim) * length_squared(hit.p - reference_p) /
           cos_light;
}

template <>
struct EmitterFunctions<AreaEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f u,
                                         EmitterSample& s) {
        return area_sample_direct<F>(view, e, reference_p, u.z, {u.x, u.y}, s);
    }
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView& view, const Emitter& e, Vec3f u, Vec2f u_direction,
                                           EmissionSample& s) {
        const SurfacePoint point = area_sample_point<F>(view, e, u.z, {u.x, u.y});
        const Vec3f local = square_to_cosine_hemisphere(u_direction);
        s.p = point.p;
        s.prim = point.prim;
        s.p_error = point.p_error;
        s.ng = point.ng;
        s.d = frame_from_normal(point.ng).to_world(local);
        s.cos_theta = local.z;
        s.opacity = area_opacity<F>(view, e, point.uv);
        s.radiance = area_radiance<F>(view, e, point.uv, s.opacity);
        s.pdf_pos = area_pdf_position(view, e, point.prim);
        s.pdf_dir = local.z * kInvPi;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter&, Vec3f ng, Vec3f d) {
        return max(dot(ng, d), 0.0f) * kInvPi;
    }
};

}  // namespace ambilux
