// How a direction is sampled at a vertex. A sampler of directions is a type with
//   sample<F>(vertex, u, mode, s)   as scatter_sample; `s` has the densities of this sampler, there and back
//   evaluate<F>(vertex, wo, mode)   as scatter_evaluate, with those densities
// so that weights know it wherever light may go by such a direction. `mode` tells the side: with radiance the density
// there is that of eye subpaths and the one back that of light subpaths, with importance the other way round. It may
// have
//   complete<F>(side, vertex, before, path)   what else is known of the ray `path` that left the vertex, before
//   roulette
// where deltas have another probability from either side, among others; `before`: the throughput at the vertex. A model
// of weights names it (Mis::Directions), and Rules hold it. Of a vertex that comes from a queue it may ask for what is
// kept: point.p, point.ng and the scattering.
#pragma once

#include "models/features.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

template <class Mis>
struct Vertex;

/// The BSDF alone (transport/subpath/bsdf_directions.h).
struct BsdfDirections {
    char nothing[0];  ///< no size, or Rules would grow, and all parameters of kernels behind it would move

    template <Features F, class Mis>
    AMBILUX_HD static bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s);
    template <Features F, class Mis>
    AMBILUX_HD static BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode);
};

}  // namespace ambilux
