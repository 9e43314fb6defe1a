// Connections draw from a cache, as many as the pixel of their eye subpath has.
#pragma once

#include "integrators/bdpt/aware/pixel_mis.h"
#include "stages/light_vertex_search.h"

namespace ambilux {

struct PixelSearch;

/// LightVertexSource.
struct PixelSource {
    using Mis = PixelMis;
    using Learn = LearnNothing;

    LightVertices<Mis> vertices;
    uint32_t most;  ///< draws of any eye vertex
    bool coherent;

    /// Searches begin from here; the first step goes back to what the pixel has.
    AMBILUX_HD uint32_t first(uint32_t) const { return most; }
    static LearnNothing learn() { return {}; }
    AMBILUX_HD static uint32_t link(const Vertex<Mis>& v, uint32_t) { return uint32_t(v.sums.draws); }
    AMBILUX_HD PixelSearch search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                  uint32_t draws) const;
};

/// LightVertexSearch.
struct PixelSearch {
    LightVertexSource<PixelMis> source;  ///< with the draws of this pixel
    const RngKey& key;
    uint32_t depth;
    const Vertex<PixelMis>& z;
    uint32_t max_depth;

    AMBILUX_HD const LightVertexSource<PixelMis>& draw(uint32_t) const { return source; }
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        if (next != kNone) next = source.draws == 0 ? kNone : min(next, source.draws);
        if (next == kNone) return kNone;
        return LightVertexSearch<PixelMis>{source, key, depth, z, max_depth}.find(next);
    }
};

AMBILUX_HD PixelSearch PixelSource::search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                           uint32_t draws) const {
    return {{vertices, nullptr, draws, coherent}, key, depth, z, max_depth};
}

}  // namespace ambilux
