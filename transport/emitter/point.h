// Point emitter: constant radiant intensity.
#pragma once

#include "transport/emitter/sample.h"

namespace ambilux {

/// Geometry of light from a single position; false when the reference lies on it.
AMBILUX_HD bool sample_position_direct(const Emitter& emitter, Vec3f reference_p, EmitterSample& s) {
    const Vec3f to_light = emitter.position - reference_p;
    const float d2 = length_squared(to_light);
    if (!(d2 > 0.0f)) return false;
    s.p = emitter.position;
    s.p_error = {0, 0, 0};
    s.distance = sqrtf(d2);
    s.wi = to_light * (1.0f / s.distance);
    s.ng = -s.wi;
    s.pdf_sa = emitter.pick_probability;
    s.delta = true;
    return true;
}

AMBILUX_HD bool point_sample_direct(const Emitter& emitter, Vec3f reference_p, EmitterSample& s) {
    if (!sample_position_direct(emitter, reference_p, s)) return false;
    s.radiance = emitter.radiance.value * (1.0f / sqr(s.distance));
    return true;
}

template <>
struct EmitterFunctions<PointEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView&, const Emitter& e, Vec3f reference_p, Vec3f,
                                         EmitterSample& s) {
        return point_sample_direct(e, reference_p, s);
    }
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView&, const Emitter&, Vec3f, Vec2f u_direction,
                                           EmissionSample& s) {
        s.d = square_to_sphere(u_direction);
        s.pdf_dir = kInv4Pi;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter&, Vec3f, Vec3f) {
        return kInv4Pi;
    }
};

}  // namespace ambilux
