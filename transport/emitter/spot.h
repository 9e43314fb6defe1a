// Spot emitter: a cone of intensity around its axis, full inside of the beam width, from there falling linearly in the
// angle to zero at the cutoff; optionally coloured by a projected texture (Mitsuba's spot).
#pragma once

#include "transport/emitter/point.h"
#include "transport/texture.h"

namespace ambilux {

/// Radiant intensity of the spot along unit `w`, world space.
template <Features F>
AMBILUX_HD Rgb spot_intensity(const SceneView& view, const Emitter& emitter, Vec3f w) {
    const Vec3f local = normalize(emitter.to_local.vector(w));
    if (!(local.z > emitter.cos_cutoff)) return {0, 0, 0};
    Rgb intensity = emitter.radiance.value;
    if (F.textures && emitter.radiance.texture >= 0) {
        // The square around the cutoff circle on the plane z = 1 maps to the unit square.
        const float cos2 = sqr(emitter.cos_cutoff);
        const float scale = 0.5f * emitter.cos_cutoff / (safe_sqrt(1.0f - cos2) * local.z);
        intensity = eval_rgb<F>(view, emitter.radiance, {0.5f + local.x * scale, 0.5f + local.y * scale});
    }
    if (local.z >= emitter.cos_beam_width) return intensity;
    const float cutoff = acosf(emitter.cos_cutoff), beam = acosf(emitter.cos_beam_width);
    return intensity * clamp((cutoff - acosf(local.z)) / (cutoff - beam), 0.0f, 1.0f);
}

template <Features F>
AMBILUX_HD bool spot_sample_direct(const SceneView& view, const Emitter& emitter, Vec3f reference_p, EmitterSample& s) {
    if (!sample_position_direct(emitter, reference_p, s)) return false;
    s.radiance = spot_intensity<F>(view, emitter, -s.wi) * (1.0f / sqr(s.distance));
    return true;
}

template <>
struct EmitterFunctions<SpotEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f,
                                         EmitterSample& s) {
        return spot_sample_direct<F>(view, e, reference_p, s);
    }
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView& view, const Emitter& e, Vec3f, Vec2f u_direction,
                                           EmissionSample& s) {
        s.d = frame_from_normal(e.direction).to_world(square_to_cone(u_direction, 1.0f - e.cos_cutoff));
        s.radiance = spot_intensity<F>(view, e, s.d);
        s.pdf_dir = kInv2Pi / (1.0f - e.cos_cutoff);
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter& e, Vec3f, Vec3f d) {
        return dot(e.direction, d) > e.cos_cutoff ? kInv2Pi / (1.0f - e.cos_cutoff) : 0.0f;
    }
};

}  // namespace ambilux
