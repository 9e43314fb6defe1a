// Rough plastic: a rough dielectric coating over a diffuse base (Mitsuba's roughplastic), front side only.
// Transmittances of the coating come from a table (transport/bsdf/precompute.h).
#pragma once

#include "models/bsdf/rough_plastic.h"
#include "transport/bsdf/microfacet.h"
#include "transport/bsdf/plastic.h"

namespace ambilux {

template <class Facets>
struct BsdfAt<RoughPlastic, Facets> : Resolved<RoughPlastic> {
    const float32* tables;  ///< SceneView::tables

    AMBILUX_HD Facets microfacets() const { return Facets::of(distribution, alpha, alpha); }
    AMBILUX_HD float transmittance(float cosine) const {
        const float32* table = tables + transmittance_table;
        const float x = min(cosine, 1.0f) * float(kTransmittanceTableSize - 1);
        const uint32_t i = x < float(kTransmittanceTableSize - 2) ? uint32_t(x) : kTransmittanceTableSize - 2;
        return lerp(table[i], table[i + 1], x - float(i));
    }

    AMBILUX_HD float probability(float passed) const {
        return specular_probability(1.0f - passed, passed, specular_sampling_weight);
    }

    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const { return formula_apart(*this, wi, wo); }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        float cos_m;
        const Vec3f m = half_vector(wi, wo, cos_m);
        if (!(cos_m > 0.0f)) return no_scattering();
        const float ti = transmittance(wi.z), to = transmittance(wo.z), pi = probability(ti), po = probability(to);
        const float cosine = wo.z * kInvPi;
        const MicrofacetReflection coating = microfacets().reflection(wi, wo, m, cos_m, sample_visible);
        const float passed = ti * to / (ior * ior) * cosine;
        return {specular_reflectance * (fresnel_dielectric(cos_m, ior).reflectance * coating.value) +
                    internal_scattering(reflectance, fdr_internal, nonlinear) * passed,
                pi * coating.pdf_sa + (1.0f - pi) * cosine,
                po * coating.pdf_reverse_sa + (1.0f - po) * (wi.z * kInvPi)};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        Vec3f wo;
        if (u.x < probability(transmittance(wi.z))) {
            const Vec3f m = microfacets().sample(wi, {u.y, u.z}, sample_visible);
            if (!(dot(wi, m) > 0.0f)) return false;
            wo = normalize(reflect(wi, m));
        } else {
            wo = square_to_cosine_hemisphere({u.y, u.z});
        }
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, 0, out);
    }
};

}  // namespace ambilux
