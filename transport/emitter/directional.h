// Directional emitter: light from infinity along `direction`, given by the irradiance on a perpendicular surface.
#pragma once

#include "transport/emitter/sample.h"

namespace ambilux {

/// Puts the sampled point of a light at infinity beyond everything in the scene.
AMBILUX_HD void place_at_infinity(const SceneView& view, Vec3f reference_p, EmitterSample& s) {
    const float far_enough = 2.0f * max(view.bounds_radius, length(reference_p - view.bounds_center));
    s.p = reference_p + s.wi * far_enough;
    s.p_error = {0, 0, 0};
    s.ng = -s.wi;
    s.distance = kInfinity;
}

AMBILUX_HD bool directional_sample_direct(const SceneView& view, const Emitter& emitter, Vec3f reference_p,
                                          EmitterSample& s) {
    s.wi = -emitter.direction;
    place_at_infinity(view, reference_p, s);
    s.radiance = emitter.radiance.value;
    s.pdf_sa = emitter.pick_probability;
    s.delta = true;
    return true;
}

template <>
struct EmitterFunctions<DirectionalEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f,
                                         EmitterSample& s) {
        return directional_sample_direct(view, e, reference_p, s);
    }
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView&, const Emitter& e, Vec3f, Vec2f, EmissionSample& s) {
        s.d = e.direction;
        s.pdf_dir = 1.0f;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter&, Vec3f, Vec3f) {
        return 1.0f;
    }
};

}  // namespace ambilux
