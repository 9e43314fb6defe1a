// Smooth conductor: mirror with the conductor's Fresnel reflectance, front side only.
#pragma once

#include "models/bsdf/conductor.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<Conductor> : Resolved<Conductor> {
    AMBILUX_HD bool sample(Vec3f wi, Vec3f, TransportMode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        out = {reflect(wi), 1.0f, 1.0f, specular_reflectance * fresnel_conductor(wi.z, eta, k), 1.0f, kScatterDelta};
        return true;
    }
};

}  // namespace ambilux
