// Rough diffuse reflection (Oren and Nayar 1994, "Generalization of Lambert's Reflectance Model", equations 30 and 31:
// the full qualitative model with interreflection; Mitsuba's roughdiffuse with use_fast_approx = false, its default).
#pragma once

#include "core/sampling.h"
#include "models/bsdf/rough_diffuse.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<RoughDiffuse> : Resolved<RoughDiffuse> {
    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        const float sigma2 = 0.5f * alpha * alpha;
        const float sin_i = safe_sqrt(1.0f - wi.z * wi.z), sin_o = safe_sqrt(1.0f - wo.z * wo.z);
        const float sines = sin_i * sin_o;
        const float cos_phi = sines > 1e-12f ? clamp((wi.x * wo.x + wi.y * wo.y) / sines, -1.0f, 1.0f) : 0.0f;
        // The paper's alpha is the larger polar angle, beta the smaller.
        const float cos_a = min(wi.z, wo.z), cos_b = max(wi.z, wo.z);
        const float sin_a = max(sin_i, sin_o), sin_b = min(sin_i, sin_o);
        const float a = acosf(min(cos_a, 1.0f));
        // 1 - 2b/pi, by the complement: cos b may be tiny and is divided by below.
        const float flat = 2.0f * kInvPi * asinf(min(cos_b, 1.0f)), steep = 1.0f - flat, b = kPiOver2 * steep;
        // sin a - (2b/pi)³ without cancellation; not negative, because sin a >= sin b >= 2b/pi.
        const float rest = max(flat * (3.0f - flat * (3.0f - flat)) - cos_a * cos_a / (1.0f + sin_a), 0.0f);
        const float c = sigma2 / (sigma2 + 0.09f);
        const float c1 = 1.0f - 0.5f * sigma2 / (sigma2 + 0.33f);
        const float c2 = 0.45f * c * (cos_phi >= 0.0f ? sin_a : rest);
        const float c3 = 0.125f * c * sqr(4.0f * a * b * kInvPi * kInvPi);
        const float c4 = 0.17f * sigma2 / (sigma2 + 0.13f);
        // tan((a+b)/2) = (sin a + sin b)/(cos a + cos b).
        const float single =
            c1 + cos_phi * c2 * (sin_b / cos_b) + (1.0f - fabsf(cos_phi)) * c3 * ((sin_a + sin_b) / (cos_a + cos_b));
        const float twice = c4 * (1.0f - cos_phi * steep * steep);
        const float pdf_sa = wo.z * kInvPi;
        // The fit may fall below zero at opposite grazing directions.
        return {max(reflectance * single + reflectance * reflectance * twice, splat(0.0f)) * pdf_sa, pdf_sa,
                wi.z * kInvPi};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        const Vec3f wo = square_to_cosine_hemisphere({u.y, u.z});
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, 0, out);
    }
};

}  // namespace ambilux
