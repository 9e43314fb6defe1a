// Connections draw from the light vertices of the whole iteration.
#pragma once

#include "integrators/bdpt/vcm/grid.h"
#include "stages/light_vertex_search.h"

namespace ambilux {

struct VcmSearch;

/// LightVertexSource.
struct VcmSource {
    using Mis = MergingMis;
    using Learn = LearnNothing;

    LightVertices<Mis> vertices;
    uint32_t draws;
    float light_subpaths;  ///< of an iteration

    AMBILUX_HD uint32_t first(uint32_t) const { return draws; }
    AMBILUX_HD bool from_cache() const { return true; }
    AMBILUX_HD static NoNote note(const Candidate<Mis>&, Rgb, const WaveState&) { return {}; }
    static LearnNothing learn() { return {}; }
    AMBILUX_HD static uint32_t link(const Vertex<Mis>&, uint32_t slot) { return slot; }
    AMBILUX_HD VcmSearch search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                uint32_t) const;
    /// M vertices of N subpaths are in the cache, and k draws estimate the sum over a subpath's vertices.
    AMBILUX_HD float scale(const WaveState&) const {
        return float(vertices.counter->size()) / (light_subpaths * float(draws));
    }
};

/// LightVertexSearch over that cache.
struct VcmSearch {
    const VcmSource& source;
    LightVertexSource<MergingMis> cache;
    const RngKey& key;
    uint32_t depth;
    const Vertex<MergingMis>& z;
    uint32_t max_depth;

    AMBILUX_HD const VcmSource& draw(uint32_t) const { return source; }
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        return LightVertexSearch<MergingMis>{cache, key, depth, z, max_depth}.find(next);
    }
};

AMBILUX_HD VcmSearch VcmSource::search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                       uint32_t) const {
    return {*this, {vertices, nullptr, draws, false}, key, depth, z, max_depth};
}

}  // namespace ambilux
