// s >= 2, t >= 2: an eye vertex and a light vertex.
#pragma once

#include "transport/mis/bidirectional.h"
#include "transport/subpath/bsdf_directions.h"
#include "transport/subpath/rules.h"
#include "transport/subpath/vertex.h"

namespace ambilux {

/// False if no light can pass between two vertices, told from places and types of BSDFs: most pairs in a room face away
/// from each other. Searches ask the same of the 32 bytes that a queue's vertex begins with (items/vertex_items.h), to
/// load no more of these pairs. connection() asks again, since that answer is another one where they graze: it knows
/// the searching vertex before a queue rounds it, compares signs instead of products, and streaming asks whether the
/// eye vertex lies in the plane of the light vertex. So what decides is the same for all schedules, and for those that
/// search nothing.
template <class Mis>
AMBILUX_HD bool may_connect(const Vertex<Mis>& y, const Vertex<Mis>& z) {
    const Vec3f w = z.point.p - y.point.p;
    return may_scatter(y.scattering, w) && may_scatter(z.scattering, -w) && !in_plane(z, w);
}

/// The eye end `z` and the light end `y`. False if that gives nothing.
template <Features F, class Mis>
AMBILUX_HD bool connection(const Rules<Mis>& rules, const SubpathEnd<Mis>& z, const SubpathEnd<Mis>& y,
                           Candidate<Mis>& c) {
    c.strategy = Strategy::make(y.depth + 1, z.depth + 1);
    if (!rules.wants(y.depth + 1, z.depth + 1)) return false;
    if (is_zero(y.throughput) || is_zero(z.throughput)) return false;  // black diffuse surfaces
    const Vec3f to_y = y.vertex.point.p - z.vertex.point.p;
    const float d2 = length_squared(to_y);
    if (!(d2 > 0.0f) || !may_connect(y.vertex, z.vertex)) return false;
    const Vec3f w = to_y * inverse_sqrt(d2);
    const BsdfValue f_z = rules.directions.template evaluate<F>(z.vertex, w, TransportMode::radiance);
    if (is_zero(f_z.value)) return false;
    const BsdfValue f_y = rules.directions.template evaluate<F>(y.vertex, -w, TransportMode::importance);
    if (is_zero(f_y.value)) return false;
    c.value = y.throughput * f_y.value * f_z.value * z.throughput * (1.0f / d2);
    const float cos_y = fabsf(dot(y.vertex.point.ng, w)), cos_z = fabsf(dot(z.vertex.point.ng, w));
    const ConnectionDensities densities = {f_z.pdf_sa * cos_y / d2, f_y.pdf_reverse_sa, f_y.pdf_sa * cos_z / d2,
                                           f_z.pdf_reverse_sa, cos_y * cos_z / d2};
    if (!set_segment(c, z.vertex, w, y.vertex.point.p, y.vertex.offset, y.vertex.point.ng)) return false;
    c.ratio = rules.counted(
        rules.mis.connection_ratio(y.vertex.sums, y.vertex.first, z.vertex.sums, z.vertex.first, densities));
    c.environment = false;
    return !is_zero(c.value);
}

}  // namespace ambilux
