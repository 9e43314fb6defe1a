// Directions of the BSDF, as they are sampled where eye subpaths may have to end.
#pragma once

#include "integrators/bdpt/vcm/merging_mis.h"
#include "transport/subpath/bsdf_directions.h"

namespace ambilux {

template <Features F, class Mis>
AMBILUX_HD bool MergingDirections::sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const {
    return BsdfDirections::sample<F>(v, u, mode, s) &&
           !(deltas_only && mode == TransportMode::radiance && !(s.flags & kScatterDelta));
}
template <Features F, class Mis>
AMBILUX_HD BsdfValue MergingDirections::evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) {
    return BsdfDirections::evaluate<F>(v, wo, mode);
}

}  // namespace ambilux
