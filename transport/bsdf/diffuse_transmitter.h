// Lambertian transmission from both sides (Mitsuba 0.6's difftrans), without a boundary.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/diffuse_transmitter.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<DiffuseTransmitter> : Resolved<DiffuseTransmitter> {
    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const {
        if (!((wi.z > 0.0f && wo.z < 0.0f) || (wi.z < 0.0f && wo.z > 0.0f))) return no_scattering();
        const float pdf_sa = fabsf(wo.z) * kInvPi;
        return {transmittance * pdf_sa, pdf_sa, fabsf(wi.z) * kInvPi};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) const {
        if (wi.z == 0.0f) return false;
        Vec3f wo = square_to_cosine_hemisphere({u.y, u.z});
        if (wi.z > 0.0f) wo.z = -wo.z;
        return smooth_sample(wo, evaluate(wi, wo, mode), 1.0f, kScatterTransmission, out);
    }
};

}  // namespace ambilux
