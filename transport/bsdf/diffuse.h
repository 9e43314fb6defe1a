// Lambertian reflection from the front side.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/diffuse.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <>
struct BsdfAt<Diffuse> : Resolved<Diffuse> {
    AMBILUX_HD BsdfValue evaluate(Vec3f wi, Vec3f wo, TransportMode) const {
        if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
        const float pdf_sa = wo.z * kInvPi;
        return {reflectance * pdf_sa, pdf_sa, wi.z * kInvPi};
    }

    AMBILUX_HD bool sample(Vec3f wi, Vec3f u, TransportMode, BsdfSample& out) const {
        if (!(wi.z > 0.0f)) return false;
        const Vec3f wo = square_to_cosine_hemisphere({u.y, u.z});
        out = {wo, wo.z * kInvPi, wi.z * kInvPi, reflectance, 1.0f, 0};
        return true;
    }
};

}  // namespace ambilux
