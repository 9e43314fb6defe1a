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

template <>
struct EmitterFunctions<ConstantEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f u,
                                         EmitterSample& s) {
        return constant_sample_direct(view, e, reference_p, {u.x, u.y}, s);
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
