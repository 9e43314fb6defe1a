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

}  // namespace ambilux
