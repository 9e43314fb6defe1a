// Rough dielectric boundary (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"), both
// sides.
#pragma once

#include "models/bsdf/rough_dielectric.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/microfacet.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <class Facets>
struct BsdfAt<RoughDielectric, Facets> : Resolved<RoughDielectric> {
    AMBILUX_HD Facets microfacets() const { return Facets::of(distribution, alpha_u, alpha_v); }

    /// The distribution that sample() draws from: without visible normals, widened to bound the weights (section 5.3).
    AMBILUX_HD Facets sampled_microfacets(Vec3f wi) const {
        if (sample_visible) return microfacets();
        const float scale = 1.2f - 0.2f * sqrtf(fabsf(wi.z));
        return microfacets().widened(scale);
    }

    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode mode) const {
        return formula_apart(*this, wi, wo, mode);
    }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo, TransportMode mode) const {
        if (wi.z == 0.0f || wo.z == 0.0f) return no_scattering();
        // Signs are compared, not the product, which may underflow.
        const bool above = wi.z > 0.0f, reflects = above == (wo.z > 0.0f);
        // What follows is the same, bit for bit, when the directions are exchanged, so that the weights of strategies
        // that sample a path from either end sum to one.
        Vec3f m = reflects ? wi + wo : (above ? wi : wo) + (above ? wo : wi) * ior;
        const float l2 = length_squared(m);
        if (!(l2 > 0.0f)) return no_scattering();
        m = m * copysignf(inverse_sqrt(l2), m.z);
        const float i_dot_m = dot(wi, m), o_dot_m = dot(wo, m);
        // Facets are seen from the side from which the macrosurface is seen (equations 23).
        if (!(i_dot_m * copysignf(1.0f, wi.z) > 0.0f) || !(o_dot_m * copysignf(1.0f, wo.z) > 0.0f))
            return no_scattering();

        const Vec3f i = wi * copysignf(1.0f, wi.z), o = wo * copysignf(1.0f, wo.z);
        const float cos_i = fabsf(i_dot_m), cos_o = fabsf(o_dot_m);
        const float f =
            fresnel_dielectric(reflects ? 0.5f * (i_dot_m + o_dot_m) : (above ? cos_i : cos_o), ior).reflectance;
        const float d = microfacets().d(m), sigma_i = microfacets().sigma(i), sigma_o = microfacets().sigma(o);
        // Density of m. Visible normals: D·|i·m|/sigma(i); the whole distribution: D·cos.
        const float density_i = sample_visible ? d * cos_i / sigma_i : sampled_microfacets(wi).d(m) * m.z;
        const float density_o = sample_visible ? d * cos_o / sigma_o : sampled_microfacets(wo).d(m) * m.z;
        // D·G/cos(wi)·|cos(wo)| per |i·m|, with G1 = cos/sigma.
        const float lobe = d * min(o.z / sigma_o, 1.0f) / sigma_i;
        if (reflects) {
            const float pdf_sa = f * density_i / (4.0f * cos_o), pdf_reverse_sa = f * density_o / (4.0f * cos_i);
            // The latter leaves the range of floats where both directions graze from opposite sides.
            if (!(pdf_reverse_sa < kInfinity)) return no_scattering();
            return {specular_reflectance * (f * lobe * 0.25f), pdf_sa, pdf_reverse_sa};
        }
        // Equation 17, by the index below over that above for either direction.
        const float inv = 1.0f / sqr((above ? i_dot_m : o_dot_m) + ior * (above ? o_dot_m : i_dot_m)), ior2 = ior * ior;
        const float jacobian_o = cos_o * inv * (above ? ior2 : 1.0f), jacobian_i = cos_i * inv * (above ? 1.0f : ior2);
        if (!(jacobian_o < kInfinity)) return no_scattering();
        const float scale = mode == TransportMode::importance ? 1.0f : (above ? 1.0f / ior2 : ior2);
        return {specular_transmittance * ((1.0f - f) * lobe * cos_i * jacobian_o * scale),
                (1.0f - f) * density_i * jacobian_o, (1.0f - f) * density_o * jacobian_i};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (wi.z == 0.0f) return false;
        const Vec3f i = wi * copysignf(1.0f, wi.z);
        const Vec3f m = sampled_microfacets(wi).sample(i, {u.y, u.z}, sample_visible);
        const float i_dot_m = dot(wi, m);
        if (!(i_dot_m * copysignf(1.0f, wi.z) > 0.0f)) return false;
        const FresnelDielectric f = fresnel_dielectric(i_dot_m, ior);
        const bool reflects = u.x < f.reflectance;
        if (!reflects && f.cos_t == 0.0f) return false;
        const Vec3f wo = reflects ? normalize(reflect(wi, m)) : refract(wi, m, f);
        // A facet may send light below the horizon of the macrosurface: lost, as single scattering has it.
        if (((wi.z > 0.0f) == (wo.z > 0.0f)) != reflects) return false;
        return smooth_sample(wo, evaluate(wi, wo, mode), reflects ? 1.0f : f.eta_it,
                             reflects ? 0u : uint32_t(kScatterTransmission), out);
    }
};

}  // namespace ambilux
