// Thin principled BSDF (Burley 2015, section 5, "Thin surface BSDF") as Mitsuba 3 has it, both sides. The specular
// transmission is the reflection of a rougher boundary, mirrored to the other side: a sheet does not bend light, but
// its two boundaries blur it. So mirrored, all of it is reciprocal and the same from either side.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/principled_thin.h"
#include "transport/bsdf/burley.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<PrincipledThin> : Resolved<PrincipledThin> {
    /// Those of light that passes: the roughness by which two boundaries look like one (Burley 2015, figure 15).
    AMBILUX_HD MicrofacetDistribution microfacets(bool reflects) const {
        return burley_microfacets(reflects ? roughness : roughness * (0.65f * ior - 0.35f), anisotropic);
    }
    AMBILUX_HD Rgb fresnel(float reflectance, float cosine) const {
        if (!(specular_tint > 0.0f)) return splat(reflectance);
        const Rgb tinted = burley_tinted_fresnel(base_color, ior, schlick_weight(cosine));
        return splat(reflectance * (1.0f - specular_tint)) + tinted * specular_tint;
    }
    /// Share of a diffuse lobe in value and sampling.
    AMBILUX_HD float diffuse_share(bool reflects) const {
        return (1.0f - specular) * (reflects ? 1.0f - through : through);
    }

    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const { return formula_apart(*this, wi, wo); }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo) const {
        if (wi.z == 0.0f || wo.z == 0.0f) return no_scattering();
        const bool reflects = (wi.z > 0.0f) == (wo.z > 0.0f);
        const Vec3f i = {wi.x, wi.y, fabsf(wi.z)}, o = {wo.x, wo.y, fabsf(wo.z)};
        float cos_m;
        const Vec3f m = half_vector(i, o, cos_m);
        if (!(cos_m > 0.0f)) return no_scattering();
        const float diffuse = diffuse_share(reflects);
        const Rgb lobe = reflects ? burley_diffuse(*this, i.z, o.z, cos_m) : base_color * kInvPi;
        BsdfValue v = {lobe * (diffuse * o.z), diffuse * (o.z * kInvPi), diffuse * (i.z * kInvPi)};
        if (specular > 0.0f) {
            const MicrofacetReflection main = microfacets(reflects).reflection(i, o, m, cos_m, true);
            const float f = fresnel_dielectric(cos_m, ior).reflectance;
            v.value += (reflects ? fresnel(f, cos_m) : base_color * (1.0f - f)) * (specular * main.value);
            v.pdf_sa += 0.5f * specular * main.pdf_sa;
            v.pdf_reverse_sa += 0.5f * specular * main.pdf_reverse_sa;
        }
        return v;
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (wi.z == 0.0f) return false;
        const bool glossy = u.x < specular;
        const bool reflects = u.x < (glossy ? 0.5f * specular : specular + diffuse_share(true));
        Vec3f wo;
        if (glossy) {
            const Vec3f i = {wi.x, wi.y, fabsf(wi.z)}, m = microfacets(reflects).sample(i, {u.y, u.z}, true);
            if (!(dot(i, m) > 0.0f)) return false;
            wo = normalize(reflect(i, m));
            if (!(wo.z > 0.0f)) return false;
        } else {
            wo = square_to_cosine_hemisphere({u.y, u.z});
        }
        if ((wi.z > 0.0f) != reflects) wo.z = -wo.z;
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, reflects ? 0u : uint32_t(kScatterTransmission), out);
    }
};

}  // namespace ambilux
