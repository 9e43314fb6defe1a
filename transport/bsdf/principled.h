// Principled BSDF (Burley 2012, "Physically Based Shading at Disney"; Burley 2015, "Extending the Disney BRDF to a BSDF
// with Integrated Subsurface Scattering") as Mitsuba 3 has it, without transmission; front side only.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/principled.h"
#include "transport/bsdf/burley.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

/// Normals of the clearcoat: GTR with exponent 1 (Burley 2012, appendix B, equations 4 and 5).
struct ClearcoatDistribution {
    float alpha2;

    AMBILUX_HD float d(float cosine) const {
        return (alpha2 - 1.0f) / (kPi * logf(alpha2) * (1.0f + (alpha2 - 1.0f) * cosine * cosine));
    }
    AMBILUX_HD Vec3f sample(Vec2f u) const {
        const float z2 = (1.0f - expf(logf(alpha2) * (1.0f - u.y))) / (1.0f - alpha2);
        const float z = safe_sqrt(z2), r = safe_sqrt(1.0f - z2);
        float sine, cosine;
        sin_cos_turns(u.x, sine, cosine);
        return {r * cosine, r * sine, z};
    }
    /// Smith's term of one direction, for GGX with the fixed roughness of 0.25.
    AMBILUX_HD static float g1(float cosine) {
        return 2.0f * cosine / (cosine + sqrtf(cosine * cosine + 0.0625f * (1.0f - cosine * cosine)));
    }
};

template <>
struct BsdfAt<Principled> : Resolved<Principled> {
    AMBILUX_HD MicrofacetDistribution microfacets() const { return burley_microfacets(roughness, anisotropic); }
    AMBILUX_HD ClearcoatDistribution coating() const { return {clearcoat_alpha * clearcoat_alpha}; }

    /// Shares of lobes in sampling, the diffuse one's is the rest: they do not depend on directions.
    struct Shares {
        float specular, clearcoat;
    };
    AMBILUX_HD Shares shares() const {
        const float coat = 0.25f * clearcoat, sum = 1.0f + coat + (1.0f - metallic);
        return {1.0f / sum, coat / sum};
    }

    AMBILUX_HD Rgb fresnel(float cosine) const {
        const float w = schlick_weight(cosine), dielectric = 1.0f - metallic;
        Rgb f = (base_color + (splat(1.0f) - base_color) * w) * metallic;
        f += splat(dielectric * (1.0f - specular_tint) * fresnel_dielectric(cosine, ior).reflectance);
        if (specular_tint > 0.0f) f += burley_tinted_fresnel(base_color, ior, w) * (dielectric * specular_tint);
        return f;
    }

    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const { return formula_apart(*this, wi, wo); }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        float cos_m;
        const Vec3f m = half_vector(wi, wo, cos_m);
        if (!(cos_m > 0.0f)) return no_scattering();
        const MicrofacetReflection main = microfacets().reflection(wi, wo, m, cos_m, true);
        const Shares p = shares();
        const float rest = 1.0f - p.specular - p.clearcoat;
        BsdfValue v = {
            fresnel(cos_m) * main.value + burley_diffuse(*this, wi.z, wo.z, cos_m) * ((1.0f - metallic) * wo.z),
            p.specular * main.pdf_sa + rest * (wo.z * kInvPi),
            p.specular * main.pdf_reverse_sa + rest * (wi.z * kInvPi)};
        if (clearcoat > 0.0f) {
            const float d = coating().d(min(m.z, 1.0f)), f = 0.04f + 0.96f * schlick_weight(cos_m);
            const float g = ClearcoatDistribution::g1(wi.z) * ClearcoatDistribution::g1(wo.z);
            v.value += splat(0.25f * clearcoat * f * d * g * wo.z);
            const float density = p.clearcoat * (d * m.z / (4.0f * cos_m));
            if (!(density < kInfinity)) return no_scattering();  // both graze from opposite sides
            v.pdf_sa += density;
            v.pdf_reverse_sa += density;
        }
        return v;
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        const Shares p = shares();
        Vec3f wo;
        if (u.x < p.specular + p.clearcoat) {
            const Vec3f m =
                u.x < p.specular ? microfacets().sample(wi, {u.y, u.z}, true) : coating().sample({u.y, u.z});
            if (!(dot(wi, m) > 0.0f)) return false;
            wo = normalize(reflect(wi, m));
        } else {
            wo = square_to_cosine_hemisphere({u.y, u.z});
        }
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, 0, out);
    }
};

}  // namespace ambilux
