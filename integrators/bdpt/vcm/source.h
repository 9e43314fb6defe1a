// Connections draw from all light vertices of an iteration.
#pragma once

#include "integrators/bdpt/vcm/grid.h"
#include "integrators/bdpt/vcm/policy.h"
#include "stages/light_vertex_search.h"

namespace ambilux {

template <class Mis>
struct VcmSearch;

/// LightVertexSource.
template <class MisModel>
struct VcmSourceOf {
    using Mis = MisModel;
    using Learn = LearnNothing;

    LightVertices<Mis> vertices;  ///< of all iterations that are done at once, one after the other
    const uint32_t* starts;       ///< VcmState
    const WaveState* wave;
    MergeKeys keys;
    IterationNumbers numbers;
    uint32_t draws;
    float light_subpaths;  ///< of an iteration

    static VcmSourceOf of(const VcmStateOf<Mis>& state, const WaveState* wave, const VcmPolicyOf<Mis>& p) {
        return {state.drawn(), state.starts, wave, p.keys, p.numbers(), p.cache_draws, p.subpaths()};
    }

    AMBILUX_HD uint32_t first(uint32_t) const { return draws; }
    static LearnNothing learn() { return {}; }
    AMBILUX_HD static uint32_t link(const Vertex<Mis>&, uint32_t slot) { return slot; }
    AMBILUX_HD VcmSearch<Mis> search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                     uint32_t) const;
};
using VcmSource = VcmSourceOf<MergingMis>;

/// LightVertexSearch over those of one iteration.
template <class Mis>
struct VcmSearch {
    const VcmSourceOf<Mis>& source;
    const RngKey& key;
    uint32_t depth;
    const Vertex<Mis>& z;
    uint32_t max_depth;
    uint32_t begin, size;  ///< of the iteration's vertices

    AMBILUX_HD const VcmSearch& draw(uint32_t) const { return *this; }
    AMBILUX_HD static bool from_cache() { return true; }
    AMBILUX_HD static NoNote note(const Candidate<Mis>&, Rgb, const WaveState&) { return {}; }
    /// M vertices of N subpaths are in the cache, and k draws estimate the sum over a subpath's vertices.
    AMBILUX_HD float scale(const WaveState&) const {
        return float(size) / (source.light_subpaths * float(source.draws));
    }
    /// `next`: draws that are left.
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        if (size == 0 || depth + 2 > max_depth) next = kNone;
        while (next != kNone) {
            const uint32_t light = begin + drawn_vertex(key, depth, --next, size, false);
            if (next == 0) next = kNone;
            const ConnectionVertexFront y = source.vertices.items.load_front(light);
            if (depth + y.bits.depth() + 1 <= max_depth && may_connect(y, z)) return light;
        }
        return kNone;
    }
};

template <class Mis>
AMBILUX_HD VcmSearch<Mis> VcmSourceOf<Mis>::search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z,
                                                   uint32_t max_depth, uint32_t) const {
    const uint32_t iteration = numbers.iteration(*wave, key.sample), begin = starts[keys.place(iteration, 0)];
    return {*this, key, depth, z, max_depth, begin, starts[keys.place(iteration + 1, 0)] - begin};
}

}  // namespace ambilux
