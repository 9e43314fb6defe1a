// Constant environment: the same radiance from every direction, sampled uniformly over the sphere.
#pragma once

#include "transport/emitter/directional.h"

namespace ambilux {

AMBILUX_HD bool constant_sample_direct(const SceneView& view, const Emitter& emitter, Vec3f reference_p, Vec2f u,
                                       EmitterSample& s) {
    s.wi = square_to_sphere(u);
    place_at_infinity(view, reference_p, s);
    s.radiance = emitter.radiance.value;
    s.pdf_sa = emitter.pick_probability * kInv4Pi;
    s.delta = false;
    return true;
}

}  // namespace ambilux
