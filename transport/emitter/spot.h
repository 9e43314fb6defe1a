// Spot emitter: a cone of intensity around its axis, full inside of the beam width, from there falling linearly in the
// angle to zero at the cutoff; optionally coloured by a projected texture (Mitsuba's spot).
#pragma once

#include "transport/emitter/point.h"
#include "transport/texture.h"

namespace ambilux {

/// Sets the angles of a spot, in radians: 0 < cutoff < pi/2, 0 <= beam_width <= cutoff.
inline void set_spot_angles(Emitter& e, double cutoff, double beam_width) {
    const double s = sin(0.5 * cutoff);
    e.one_minus_cos_cutoff = float(2 * s * s);
    e.cutoff = float(cutoff);
    e.beam_width = float(beam_width);
}

/// 1 - cos of the angle between the axis and unit `w`, from the chord between them: next to 1 a cosine has no digits
/// left. Components of unit vectors are off by 2^-24 at most, so that the angle is right to about 1e-7 rad: a
/// thousandth of a cutoff of 0.01 degrees, several per cent of one of 1e-4 degrees, which is what directions in floats
/// can tell.
AMBILUX_HD float spot_one_minus_cos(const Emitter& emitter, Vec3f w) {
    return 0.5f * length_squared(w - emitter.direction);
}

/// Radiant intensity of the spot along unit `w`, world space.
template <Features F>
AMBILUX_HD Rgb spot_intensity(const SceneView& view, const Emitter& emitter, Vec3f w) {
    const float v = spot_one_minus_cos(emitter, w);
    if (!(v < emitter.one_minus_cos_cutoff)) return {0, 0, 0};
    Rgb intensity = emitter.radiance.value;
    if (F.textures && emitter.radiance.texture >= 0) {
        // The square around the cutoff circle on the plane z = 1 maps to the unit square.
        const Vec3f local = emitter.to_local.vector(w);
        const float end = emitter.one_minus_cos_cutoff;
        const float scale = 0.5f * (1.0f - end) / (sqrtf(end * (2.0f - end)) * local.z);
        intensity = eval_rgb<F>(view, emitter.radiance, {0.5f + local.x * scale, 0.5f + local.y * scale});
    }
    const float angle = 2.0f * asinf(sqrtf(0.5f * v));
    if (angle <= emitter.beam_width) return intensity;
    return intensity * clamp((emitter.cutoff - angle) / (emitter.cutoff - emitter.beam_width), 0.0f, 1.0f);
}

/// Density per solid angle of light that leaves the spot along unit `w`. Its rim lies a hair outside of that of the
/// intensity: compilers round sums of products differently from copy to copy, and where there is light there must be a
/// density.
AMBILUX_HD float spot_pdf_direction(const Emitter& emitter, Vec3f w) {
    const float end = emitter.one_minus_cos_cutoff;
    return spot_one_minus_cos(emitter, w) < end * (1.0f + 0x1p-20f) ? kInv2Pi / end : 0.0f;
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
        s.d = frame_from_normal(e.direction).to_world(square_to_cone(u_direction, e.one_minus_cos_cutoff));
        s.radiance = spot_intensity<F>(view, e, s.d);
        s.pdf_dir = kInv2Pi / e.one_minus_cos_cutoff;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter& e, Vec3f, Vec3f d) {
        return spot_pdf_direction(e, d);
    }
};

}  // namespace ambilux
