// Light that leaves emitters, for walks that start there (light tracing, bidirectional path tracing; Veach 1997,
// section 8.3.2).
//
// Position and direction are sampled one after the other and carry their own measures. For all emitters alike the flux
// of a sample is
//   radiance · cos_theta / (pick · pdf_pos · pdf_dir),
// where a delta position or direction has "density" 1 and `radiance` is then intensity or irradiance. For emitters at
// infinity the direction comes first and the position lies on the disk perpendicular to it that covers the scene's
// bounding sphere.
#pragma once

#include "transport/emitter.h"

namespace ambilux {

struct EmissionSample {
    Vec3f p;          ///< where the walk starts; infinite: outside of the scene's bounding sphere
    Vec3f p_error;    ///< bound of the absolute error of each coordinate of p; zero unless p lies on a surface
    Vec3f ng;         ///< unit normal of the emitting side; d where there is no surface
    Vec3f d;          ///< unit, direction in which light leaves
    Rgb radiance;     ///< area, constant, envmap: radiance; point, spot: intensity; directional: irradiance
    float pdf_pos;    ///< density per area (infinite: on the disk); 1 for a delta position
    float pdf_dir;    ///< density per solid angle; 1 for a delta direction
    float cos_theta;  ///< cosine between ng and d; 1 where there is no surface
    float pick;       ///< probability of this emitter
    uint32_t emitter;
    uint32_t prim;  ///< area: the primitive that p lies on; otherwise kNone
    bool delta_position, delta_direction, infinite;
};

AMBILUX_HD bool is_infinite(EmitterType type) {
    return type == EmitterType::directional || type == EmitterType::constant || type == EmitterType::envmap;
}

/// Density per area with which sample_emission starts at a point of emitter `emitter`, given that it was picked: on
/// primitive `prim` of an area emitter, on the disk for emitters at infinity; 1 for delta positions.
template <Features F>
AMBILUX_HD float pdf_emission_position(const SceneView& view, uint32_t emitter, uint32_t prim) {
    const Emitter& e = view.emitters[emitter];
    if (F.has(EmitterType::area) && e.type == EmitterType::area) return area_pdf_position(view, e, prim);
    if (is_infinite(e.type)) return 1.0f / (kPi * sqr(view.bounds_radius));
    return 1.0f;
}

/// Density per solid angle with which sample_emission sends light along unit `d` from a point with emitting normal `ng`
/// (area emitters), given emitter and point; 1 for delta directions.
template <Features F>
AMBILUX_HD float pdf_emission_direction(const SceneView& view, uint32_t emitter, Vec3f ng, Vec3f d) {
    const Emitter& e = view.emitters[emitter];
    switch (e.type) {
        case EmitterType::area: return max(dot(ng, d), 0.0f) * kInvPi;
        case EmitterType::spot: return dot(e.direction, d) > e.cos_cutoff ? kInv2Pi / (1.0f - e.cos_cutoff) : 0.0f;
        case EmitterType::directional: return 1.0f;
        case EmitterType::envmap:
            if constexpr (F.has(EmitterType::envmap)) return envmap_pdf_direction(view, e, -d);
            return 0.0f;
        default: return kInv4Pi;  // point, constant
    }
}

/// Samples light leaving an emitter. `u_position` in [0,1)^4: x picks the emitter, y and z place the start, w picks the
/// primitive of a mesh or the row of an environment map; `u_direction` in [0,1)². False when the sample carries no
/// light; then `s` is not to be read.
template <Features F>
AMBILUX_HD bool sample_emission(const SceneView& view, Vec4f u_position, Vec2f u_direction, EmissionSample& s) {
    if (view.emitter_count == 0) return false;
    s.emitter = sample_cdf(view.emitter_cdf, view.emitter_count, u_position.x);
    const Emitter& e = view.emitters[s.emitter];
    const Vec2f u = {u_position.y, u_position.z};
    s.pick = e.pick_probability;
    s.infinite = is_infinite(e.type);
    s.delta_position = e.type == EmitterType::point || e.type == EmitterType::spot;
    s.delta_direction = e.type == EmitterType::directional;
    s.cos_theta = 1.0f;
    s.prim = kNone;
    s.pdf_dir = 0.0f;
    s.p_error = {0, 0, 0};
    s.p = e.position;
    s.pdf_pos = 1.0f;
    s.radiance = e.radiance.value;
    switch (e.type) {
        case EmitterType::area:
            if constexpr (F.has(EmitterType::area)) {
                const SurfacePoint point = area_sample_point<F>(view, e, u_position.w, u);
                const Vec3f local = square_to_cosine_hemisphere(u_direction);
                s.p = point.p;
                s.prim = point.prim;
                s.p_error = point.p_error;
                s.ng = point.ng;
                s.d = frame_from_normal(point.ng).to_world(local);
                s.cos_theta = local.z;
                s.radiance = eval_rgb<F>(view, e.radiance, point.uv);
                s.pdf_pos = area_pdf_position(view, e, point.prim);
                s.pdf_dir = local.z * kInvPi;
            }
            break;
        case EmitterType::point:
            s.d = square_to_sphere(u_direction);
            s.pdf_dir = kInv4Pi;
            break;
        case EmitterType::spot:
            if constexpr (F.has(EmitterType::spot)) {
                s.d = frame_from_normal(e.direction).to_world(square_to_cone(u_direction, 1.0f - e.cos_cutoff));
                s.radiance = spot_intensity<F>(view, e, s.d);
                s.pdf_dir = kInv2Pi / (1.0f - e.cos_cutoff);
            }
            break;
        case EmitterType::directional:
            s.d = e.direction;
            s.pdf_dir = 1.0f;
            break;
        case EmitterType::constant:
            s.d = square_to_sphere(u_direction);
            s.pdf_dir = kInv4Pi;
            break;
        case EmitterType::envmap:
            if constexpr (F.has(EmitterType::envmap)) {
                Vec2f uv;
                envmap_sample_direction(view, e, {u_direction.x, u_direction.y, u_position.w}, s.d, uv, s.pdf_dir);
                s.radiance = envmap_lookup(view, e, uv);
                s.d = -s.d;
            }
            break;
        default: return false;
    }
    if (e.type != EmitterType::area) s.ng = s.d;
    if (s.infinite) {
        const float r = view.bounds_radius;
        const Vec2f disk = square_to_disk(u);
        const Frame frame = frame_from_normal(s.d);
        // A little farther out than the sphere, so that a surface that touches it still lies ahead.
        s.p = view.bounds_center + (frame.s * disk.x + frame.t * disk.y - s.d * 1.01f) * r;
        s.pdf_pos = 1.0f / (kPi * r * r);
    }
    // Written so that NaN fails too.
    const float pdf = s.pdf_pos * s.pdf_dir;
    return pdf > 0.0f && pdf < kInfinity && max_component(s.radiance) > 0.0f;
}

}  // namespace ambilux
