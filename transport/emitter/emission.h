// Light that leaves emitters, for subpaths that start there (light tracing, bidirectional path tracing; Veach 1997,
// section 8.3.2).
//
// Position and direction are sampled one after the other and carry their own measures. For all emitters alike the flux
// of a sample is
//   radiance · cos_theta / (pick · pdf_pos · pdf_dir),
// where a delta position or direction has "density" 1 and `radiance` is then intensity or irradiance; of emitters with
// both, power, and of those that send every point's light along its normal, power per area. For emitters at infinity
// the direction comes first and the position lies on the disk perpendicular to it that covers the scene's bounding
// sphere.
#pragma once

#include "transport/emitter.h"

namespace ambilux {

/// Density per area with which sample_emission starts at a point of emitter `emitter`, given that it was picked: on
/// primitive `prim` of an area emitter, on the disk for emitters at infinity; 1 for delta positions. Not for beams
/// (is_beam): no other strategy has a density to compare.
template <Features F>
AMBILUX_HD float pdf_emission_position(const SceneView& view, uint32_t emitter, uint32_t prim) {
    const Emitter& e = view.emitters[emitter];
    if (F.has(EmitterType::area) && e.type == EmitterType::area) return area_pdf_position(view, e, prim);
    if (is_infinite(e.type)) return 1.0f / (kPi * sqr(view.bounds_radius));
    return 1.0f;
}

/// Density per solid angle with which sample_emission sends light along unit `d` from a point with emitting normal `ng`
/// (area emitters), given emitter and point; 1 for delta directions. Of a sampled direction: pdf_dir to 2^-20 / pi.
template <Features F>
AMBILUX_HD float pdf_emission_direction(const SceneView& view, uint32_t emitter, Vec3f ng, Vec3f d) {
    const Emitter& e = view.emitters[emitter];
    return visit_emitter<F>(e.type, 0.0f, [&](auto model) {
        return EmitterFunctions<typename decltype(model)::type>::template pdf_emission_direction<F>(view, e, ng, d);
    });
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
    s.delta_position = has_delta_position(e.type);
    s.delta_direction = has_delta_direction(e.type);
    s.cos_theta = 1.0f;
    s.opacity = 1.0f;
    s.prim = kNone;
    s.pdf_dir = 0.0f;
    s.p_error = {0, 0, 0};
    s.p = e.position;
    s.pdf_pos = 1.0f;
    s.radiance = e.radiance.value;
    const bool known = visit_emitter<F>(e.type, false, [&](auto model) {
        EmitterFunctions<typename decltype(model)::type>::template sample_emission<F>(view, e, {u.x, u.y, u_position.w},
                                                                                      u_direction, s);
        return true;
    });
    if (!known) return false;
    if (s.prim == kNone) s.ng = s.d;
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
