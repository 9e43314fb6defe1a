// Modified Phong BRDF (Lafortune and Willems 1994, "Using the Modified Phong Reflectance Model for Physically Based
// Rendering", equations 5 and 6), Mitsuba 0.6's phong; front side only.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/phong.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<Phong> : Resolved<Phong> {
    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const { return formula_apart(*this, wi, wo); }
    AMBILUX_HD BsdfValue formula(Vec3f wi, Vec3f wo) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        // Cosine between one direction and the mirror image of the other: the same when they are exchanged.
        const float cos_lobe = wi.z * wo.z - (wi.x * wo.x + wi.y * wo.y);
        const float power = cos_lobe > 0.0f ? expf(exponent * logf(min(cos_lobe, 1.0f))) : 0.0f;
        const float p = specular_sampling_weight, lobe = p * (exponent + 1.0f) * (0.5f * kInvPi) * power;
        return {(reflectance * kInvPi + specular_reflectance * ((exponent + 2.0f) * (0.5f * kInvPi) * power)) * wo.z,
                lobe + (1.0f - p) * (wo.z * kInvPi), lobe + (1.0f - p) * (wi.z * kInvPi)};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        Vec3f wo;
        if (u.x < specular_sampling_weight) {
            const float z = expf(logf(1.0f - u.y) / (exponent + 1.0f)), r = safe_sqrt((1.0f - z) * (1.0f + z));
            float sine, cosine;
            sin_cos_turns(u.z, sine, cosine);
            wo = normalize(frame_from_normal(reflect(wi)).to_world({r * cosine, r * sine, z}));
        } else {
            wo = square_to_cosine_hemisphere({u.y, u.z});
        }
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, 0, out);
    }
};

}  // namespace ambilux
