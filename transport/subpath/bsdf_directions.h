// Directions that the BSDF samples.
#pragma once

#include "transport/subpath/directions.h"
#include "transport/subpath/vertex.h"
#include "transport/surface_scattering.h"

namespace ambilux {

template <Features F, class Mis>
AMBILUX_HD bool BsdfDirections::sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) {
    return scatter_sample<F>(v.scattering, u, mode, s);
}
template <Features F, class Mis>
AMBILUX_HD BsdfValue BsdfDirections::evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode) {
    return scatter_evaluate<F>(v.scattering, wo, mode);
}

}  // namespace ambilux
