// Rough plastic: a rough dielectric coating over a diffuse base (Mitsuba's roughplastic), front side only. Transmittances of the
// coating come from a table (transport/bsdf/precompute.h).
#pragma once

#include "transport/bsdf/microfacet.h"
#include "transport/bsdf/plastic.h"

namespace ambilux {

struct RoughPlastic {
    Rgb reflectance, specular_reflectance;
    float ior, fdr_internal, specular_sampling_weight;
    bool nonlinear;
    MicrofacetDistribution microfacets;
    bool sample_visible;
    const float* table;  ///< kTransmittanceTableSize entries

    AMBILUX_HD float transmittance(float cosine) const {
        const float x = min(cosine, 1.0f) * float(kTransmittanceTableSize - 1);
        const uint32_t i = x < float(kTransmittanceTableSize - 2) ? uint32_t(x) : kTransmittanceTableSize - 2;
        return lerp(table[i], table[i + 1], x - float(i));
    }

    AMBILUX_HD float probability(float passed) const {
        return specular_probability(1.0f - passed, passed, specular_sampling_weight);
    }

    AMBILUX_HD_APART BsdfValue evaluate(Vec3f wi, Vec3f wo) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        const Vec3f m = normalize(wi + wo);
        const float i_dot_m = dot(wi, m);
        if (!(i_dot_m > 0.0f)) return no_scattering();
        const float ti = transmittance(wi.z), to = transmittance(wo.z), p = probability(ti);
        const float cosine = wo.z * kInvPi;
        const float coating = fresnel_dielectric(i_dot_m, ior).reflectance * microfacets.d(m) * microfacets.g1(wo) /
                              (4.0f * microfacets.sigma(wi));
        const float passed = ti * to / (ior * ior) * cosine;
        const float coating_pdf = microfacets.pdf(wi, m, sample_visible) / (4.0f * i_dot_m);
        return {specular_reflectance * coating + internal_scattering(reflectance, fdr_internal, nonlinear) * passed,
                p * coating_pdf + (1.0f - p) * cosine};
    }
    AMBILUX_HD Rgb eval(Vec3f wi, Vec3f wo, TransportMode) const { return evaluate(wi, wo).value; }
    AMBILUX_HD float pdf(Vec3f wi, Vec3f wo, TransportMode) const { return evaluate(wi, wo).pdf_sa; }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        Vec3f wo;
        if (u.x < probability(transmittance(wi.z))) {
            const Vec3f m = microfacets.sample(wi, {u.y, u.z}, sample_visible);
            if (!(dot(wi, m) > 0.0f)) return false;
            wo = normalize(reflect(wi, m));
        } else {
            wo = square_to_cosine_hemisphere({u.y, u.z});
        }
        return smooth_sample(wo, evaluate(wi, wo), 1.0f, 0, out);
    }
};

}  // namespace ambilux
