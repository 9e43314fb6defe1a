// Rough conductor: microfacet reflection with separable Smith masking (Walter et al. 2007, equation 20), front side
// only.
#pragma once

#include "models/bsdf/rough_conductor.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/microfacet.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <class Facets>
struct BsdfAt<RoughConductor, Facets> : Resolved<RoughConductor> {
    AMBILUX_HD Facets microfacets() const { return Facets::of(distribution, alpha_u, alpha_v); }

    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const { return formula_apart(*this, wi, wo); }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        float cosine;
        const Vec3f m = half_vector(wi, wo, cosine);
        if (!(cosine > 0.0f)) return no_scattering();
        const MicrofacetReflection f = microfacets().reflection(wi, wo, m, cosine, sample_visible);
        return {specular_reflectance * fresnel_conductor(cosine, eta, k) * f.value, f.pdf_sa, f.pdf_reverse_sa};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        const Vec3f m = microfacets().sample(wi, {u.y, u.z}, sample_visible);
        if (!(dot(wi, m) > 0.0f)) return false;
        const Vec3f wo = normalize(reflect(wi, m));
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, 0, out);
    }
};

}  // namespace ambilux
