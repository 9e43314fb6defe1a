// Projector: light from a point through the frustum of a perspective camera, such that a plane across its axis is lit
// by its texture evenly (Mitsuba's projector).
#pragma once

#include "transport/emitter/point.h"
#include "transport/texture.h"

namespace ambilux {

/// A direction on the plane z = 1 of the projector, in tangents of half the field of view; false behind it.
AMBILUX_HD bool projector_plane(const Emitter& emitter, Vec3f w, Vec2f& at, float& cosine) {
    const Vec3f local = emitter.to_local.vector(w);
    cosine = local.z;
    if (!(local.z > 0.0f)) return false;
    at = {local.x / (local.z * emitter.cutoff), local.y / (local.z * emitter.beam_width)};
    return true;
}

/// Radiant intensity of the projector along unit `w`, world space: over cos³, since the plane is lit at a distance of
/// 1/cos under that cosine.
template <Features F>
AMBILUX_HD Rgb projector_intensity(const SceneView& view, const Emitter& emitter, Vec3f w) {
    Vec2f at;
    float cosine;
    if (!projector_plane(emitter, w, at, cosine) || !(fabsf(at.x) <= 1.0f) || !(fabsf(at.y) <= 1.0f)) return {0, 0, 0};
    // As the image of a camera: +x is left, +y up, and the first row on top.
    const Vec2f uv = {0.5f - 0.5f * at.x, 0.5f - 0.5f * at.y};
    return eval_rgb<F>(view, emitter.radiance, uv) * (1.0f / (cosine * cosine * cosine));
}

/// Density per solid angle of light that leaves along unit `w`: uniform on the plane. Its rim lies a hair outside of
/// that of the intensity, as the spot's does.
AMBILUX_HD float projector_pdf_direction(const Emitter& emitter, Vec3f w) {
    Vec2f at;
    float cosine;
    constexpr float kRim = 1.0f + 0x1p-20f;
    if (!projector_plane(emitter, w, at, cosine) || !(fabsf(at.x) <= kRim) || !(fabsf(at.y) <= kRim)) return 0.0f;
    return 1.0f / (4.0f * emitter.cutoff * emitter.beam_width * cosine * cosine * cosine);
}

template <>
struct EmitterFunctions<ProjectorEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f,
                                         EmitterSample& s) {
        if (!sample_position_direct(e, reference_p, s)) return false;
        s.radiance = projector_intensity<F>(view, e, -s.wi) * (1.0f / sqr(s.distance));
        return true;
    }
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView& view, const Emitter& e, Vec3f, Vec2f u_direction,
                                           EmissionSample& s) {
        const Vec3f local = {(2.0f * u_direction.x - 1.0f) * e.cutoff, (2.0f * u_direction.y - 1.0f) * e.beam_width,
                             1.0f};
        s.d = normalize(e.to_world.vector(local));
        s.radiance = projector_intensity<F>(view, e, s.d);
        s.pdf_dir = projector_pdf_direction(e, s.d);
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter& e, Vec3f, Vec3f d) {
        return projector_pdf_direction(e, d);
    }
};

}  // namespace ambilux
