// The next ray of a subpath.
#pragma once

#include "transport/subpath/bsdf_directions.h"
#include "transport/subpath/roulette.h"
#include "transport/subpath/rules.h"
#include "transport/subpath/vertex.h"

namespace ambilux {

/// Density of the way back over a delta, as a multiple of that of the way there. Fresnel terms are symmetric, but a
/// delta function of the direction on one side counts otherwise as one of the direction on the other: refraction
/// spreads solid angles by n_i² cos_i / (n_o² cos_o). `eta`: of the sample, n_o / n_i.
AMBILUX_HD float delta_reverse_pdf(const Scattering& s, Vec3f wo, float eta) {
    if (eta == 1.0f) return 1.0f;
    // Never 0 by rounding, where a subpath leaves along the surface.
    return fabsf(s.wi.z) / (max(fabsf(dot(s.frame.n, wo)), 1e-7f) * sqr(eta));
}

/// The same in the frame that a delta was drawn in.
template <Features F>
AMBILUX_HD float delta_reverse_pdf(const Scattering& s, const ScatterSample& drawn, TransportMode mode) {
    if constexpr (F.map_rules)
        if (s.map_rules) {
            const bool turn = turns_for(s, mode == TransportMode::radiance ? s.wi_world : drawn.wo);
            return delta_reverse_pdf(in_frame(s, turn), drawn.wo, drawn.eta);
        }
    return delta_reverse_pdf(s, drawn.wo, drawn.eta);
}

/// Scatters `path` at `vertex` with `u`: xyz for the direction, w for Russian roulette. False if the subpath ends.
template <Features F, class Mis>
AMBILUX_HD bool scatter(const Rules<Mis>& rules, Side side, const Vertex<Mis>& vertex, Vec4f u, Subpath<Mis>& path) {
    ScatterSample s;
    if (!rules.directions.template sample<F>(vertex, {u.x, u.y, u.z}, transport_mode(side), s)) return false;
    const bool delta = s.flags & kScatterDelta;
    const uint32_t met = path.depth;
    if (met + 1 == rules.max_depth && !rules.mis.counts_last_segment(delta)) return false;
    [[maybe_unused]] const Rgb before = path.throughput;
    path.throughput = path.throughput * s.weight;
    if (is_zero(path.throughput)) return false;
    const float cos_out = fabsf(dot(vertex.point.ng, s.wo));
    const float forward = delta ? 1.0f : s.pdf_sa;
    const float reverse = delta ? delta_reverse_pdf<F>(vertex.scattering, s, transport_mode(side)) : s.pdf_reverse_sa;
    path.sums = rules.mis.sums_after_scatter(vertex.sums, vertex.first, delta, forward, reverse, cos_out);
    path.origin = offset_ray_origin(vertex.point.p, vertex.offset, vertex.point.ng, s.wo);
    path.direction = s.wo;
    if (side == Side::eye) path.roulette_scale = rounded_scale(path.roulette_scale * s.eta);
    path.delta = delta;
    path.depth = met + 1;
    if constexpr (requires { rules.directions.template complete<F>(side, vertex, before, path); })
        rules.directions.template complete<F>(side, vertex, before, path);
    return met < rules.rr_depth || survives(path, rules.rr_cap, u.w);
}

}  // namespace ambilux
