// Collimated emitter: a beam without extent, all of its power along one ray (Mitsuba 0.6's collimated). Light subpaths
// alone carry it: no point but those of the ray is lit, so that no sample towards the emitter meets its light.
#pragma once

#include "transport/emitter/sample.h"

namespace ambilux {

template <>
struct EmitterFunctions<CollimatedEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView&, const Emitter&, Vec3f, Vec3f, EmitterSample&) {
        return false;
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
