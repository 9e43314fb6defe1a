// Scattering at a surface point in world space, shading normals, maps and their rules included.
#pragma once

#include "transport/map_rules.h"

namespace ambilux {

/// f(wi,wo)·|wo·ns| of the smooth lobes for unit `wo_world`, with the factor for shading normals in importance mode,
/// and, wherever that is not 0, the densities of scatter_sample.
template <Features F>
AMBILUX_HD BsdfValue scatter_evaluate(const Scattering& s, Vec3f wo_world, TransportMode mode) {
    if constexpr (F.map_rules)
        if (s.map_rules) return mapped_evaluate<F>(s, wo_world, mode);
    return evaluate_in_frame<F>(s, wo_world, mode);
}

template <Features F>
AMBILUX_HD Rgb scatter_eval(const Scattering& s, Vec3f wo_world, TransportMode mode) {
    return scatter_evaluate<F>(s, wo_world, mode).value;
}

/// Density per solid angle with which scatter_sample draws `wo_world` in radiance mode; directions that it rejects for
/// their side keep theirs.
template <Features F>
AMBILUX_HD float scatter_pdf(const Scattering& s, Vec3f wo_world) {
    const Frame frame = F.map_rules && s.map_rules ? in_frame(s, turns_for(s, s.wi_world)).frame : s.frame;
    return bsdf_pdf<F>(s.bsdf, frame.to_local(s.wi_world), frame.to_local(wo_world), TransportMode::radiance);
}

/// Draws a direction (u as for bsdf_sample); weight = scatter_eval/scatter_pdf. False when the subpath ends here.
template <Features F>
AMBILUX_HD bool scatter_sample(const Scattering& s, Vec3f u, TransportMode mode, ScatterSample& out) {
    if constexpr (F.map_rules)
        if (s.map_rules) return mapped_sample<F>(s, u, mode, out);
    return sample_in_frame<F>(s, u, mode, out);
}

}  // namespace ambilux
