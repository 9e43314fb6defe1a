// Thin dielectric plate: both boundaries at once, with all internal reflections, and no displacement or bending.
#pragma once

#include "models/bsdf/thin_dielectric.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<ThinDielectric> : Resolved<ThinDielectric> {
    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode, BsdfSample& out) const {
        if (wi.z == 0.0f) return false;
        // R + T·R·T + T·R³·T + ... with T = 1-R sums to 2R/(1+R) (Stokes 1860).
        const float r = fresnel_dielectric(fabsf(wi.z), ior).reflectance, reflectance = 2.0f * r / (1.0f + r);
        if (u.x < reflectance)
            out = {reflect(wi), reflectance, reflectance, specular_reflectance, 1.0f, kScatterDelta};
        else
            out = {-wi,
                   1.0f - reflectance,
                   1.0f - reflectance,
                   specular_transmittance,
                   1.0f,
                   kScatterDelta | kScatterTransmission};
        return true;
    }
};

}  // namespace ambilux
