// Smooth dielectric boundary: Fresnel reflection and refraction (Veach 1997, section 5.2 for the factor eta² of
// radiance).
#pragma once

#include "models/bsdf/dielectric.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<Dielectric> : Resolved<Dielectric> {
    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (wi.z == 0.0f) return false;
        const FresnelDielectric f = fresnel_dielectric(wi.z, ior);
        if (u.x < f.reflectance) {
            out = {reflect(wi), f.reflectance, f.reflectance, specular_reflectance, 1.0f, kScatterDelta};
            return true;
        }
        if (f.cos_t == 0.0f) return false;
        const float scale = mode == TransportMode::radiance ? 1.0f / sqr(f.eta_it) : 1.0f;
        out = {refract(wi, f),
               1.0f - f.reflectance,
               1.0f - f.reflectance,
               specular_transmittance * scale,
               f.eta_it,
               kScatterDelta | kScatterTransmission};
        return true;
    }
};

}  // namespace ambilux
