// Smooth plastic: a dielectric coating over a diffuse base with internal scattering (Mitsuba's plastic), front side
// only.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/plastic.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

/// Albedo of a diffuse base under a boundary that reflects the share `internal` back down, all bounces summed. Without
/// `nonlinear` the colour of the repeated bounces is left out.
AMBILUX_HD Rgb internal_scattering(Rgb diffuse, float internal, bool nonlinear) {
    if (!nonlinear) return diffuse * (1.0f / (1.0f - internal));
    return {diffuse.x / (1.0f - diffuse.x * internal), diffuse.y / (1.0f - diffuse.y * internal),
            diffuse.z / (1.0f - diffuse.z * internal)};
}

/// Share of the specular lobe in sampling when it carries `specular` and the diffuse one `diffuse` of the light.
AMBILUX_HD float specular_probability(float specular, float diffuse, float weight) {
    const float s = specular * weight, d = diffuse * (1.0f - weight);
    return s + d > 0.0f ? s / (s + d) : 0.0f;
}

template <>
struct BsdfAt<Plastic> : Resolved<Plastic> {
    AMBILUX_HD float probability(float reflected) const {
        return specular_probability(reflected, 1.0f - reflected, specular_sampling_weight);
    }

    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const { return formula_apart(*this, wi, wo); }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        const float fi = fresnel_dielectric(wi.z, ior).reflectance, fo = fresnel_dielectric(wo.z, ior).reflectance;
        const float cosine = wo.z * kInvPi;
        const float passed = (1.0f - fi) * (1.0f - fo) / (ior * ior);
        return {internal_scattering(reflectance, fdr_internal, nonlinear) * (passed * cosine),
                (1.0f - probability(fi)) * cosine, (1.0f - probability(fo)) * (wi.z * kInvPi)};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        const float f = fresnel_dielectric(wi.z, ior).reflectance, p = probability(f);
        if (u.x < p) {
            out = {reflect(wi), p, p, specular_reflectance * (f / p), 1.0f, kScatterDelta};
            return true;
        }
        const Vec3f wo = square_to_cosine_hemisphere({u.y, u.z});
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, 0, out);
    }
};

}  // namespace ambilux
