// Scattering in the frame of a surface point: the predicate for light leaks and Veach's factor for shading normals
// around every BSDF.
#pragma once

#include "transport/bsdf.h"
#include "transport/scattering.h"

namespace ambilux {

/// f(wi,wo)·|wo·ns| of the smooth lobes for unit `wo_world` in the frame of `s`, as scatter_evaluate has it.
template <Features F>
AMBILUX_HD BsdfValue evaluate_in_frame(const Scattering& s, Vec3f wo_world, TransportMode mode) {
    const Vec3f wo = s.frame.to_local(wo_world);
    if (!sides_agree(s, s.wi_world, s.wi.z) || !sides_agree(s, wo_world, wo.z)) return no_scattering();
    BsdfValue v = bsdf_evaluate<F>(s.bsdf, s.wi, wo, mode);
    v.value *= shading_normal_factor(s, wo_world, wo.z, mode);
    return v;
}

/// Draws a direction in the frame of `s`, as scatter_sample does.
template <Features F>
AMBILUX_HD bool sample_in_frame(const Scattering& s, Vec3f u, TransportMode mode, ScatterSample& out) {
    if (!sides_agree(s, s.wi_world, s.wi.z) || !bsdf_sample<F>(s.bsdf, s.wi, u, mode, out)) return false;
    const Vec3f wo = out.wo;
    out.wo = s.frame.to_world(wo);
    if (!sides_agree(s, out.wo, wo.z)) return false;
    out.weight = out.weight * shading_normal_factor(s, out.wo, wo.z, mode);
    return true;
}

}  // namespace ambilux
