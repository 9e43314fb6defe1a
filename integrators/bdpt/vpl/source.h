// An eye vertex is connected with all light vertices of the iteration, or with some of them that it draws.
#pragma once

#include "integrators/bdpt/vpl/vpl_mis.h"
#include "stages/light_vertex_search.h"

namespace ambilux {

struct VplSearch;

/// LightVertexSource.
struct VplSource {
    using Mis = VplMis;
    using Learn = LearnNothing;

    LightVertices<Mis> vertices;
    uint32_t most;         ///< connections of an eye vertex
    float light_subpaths;  ///< of an iteration
    StageRecord* clamped;  ///< connections whose geometry term was above its bound

    AMBILUX_HD static uint32_t first(uint32_t) { return 0; }
    AMBILUX_HD static bool from_cache() { return true; }
    AMBILUX_HD NoNote note(const Candidate<Mis>& c, Rgb, const WaveState&) const {
        if (c.ratio > 0.0f) clamped->count_item(c.strategy.t() - 1);
        return {};
    }
    static LearnNothing learn() { return {}; }
    AMBILUX_HD static uint32_t link(const Vertex<Mis>&, uint32_t slot) { return slot; }
    AMBILUX_HD VplSearch search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                uint32_t) const;

    AMBILUX_HD uint32_t size() const { return vertices.counter->size(); }
    AMBILUX_HD uint32_t connections() const { return min(most, size()); }
    /// What a connection is worth: the sum over all vertices is N times that over a light subpath's.
    AMBILUX_HD float scale(const WaveState&) const { return float(size()) / (light_subpaths * float(connections())); }
};

/// LightVertexSearch over them. Draws are systematic (Cochran 1977, Sampling Techniques, section 8.1): k out of M, at
/// equal distances from a random first one, each vertex with the probability k / M and none twice.
struct VplSearch {
    const VplSource& source;
    const RngKey& key;  ///< of the eye subpath
    uint32_t depth;     ///< of the eye vertex `z`
    const Vertex<VplMis>& z;
    uint32_t max_depth;  ///< of a path

    AMBILUX_HD const VplSource& draw(uint32_t) const { return source; }
    /// `next`: how many were looked at.
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        const uint32_t size = source.size(), n = depth + 2 > max_depth ? 0 : source.connections();
        const uint32_t first = n < size ? mul_hi(cache_draw(key, depth, 0).x, size) : 0;
        while (next < n) {
            const uint32_t i = next++, light = n < size ? uint32_t((uint64_t(i) * size + first) / n) : i;
            const ConnectionVertexFront y = source.vertices.items.load_front(light);
            if (depth + y.bits.depth() + 1 <= max_depth && may_connect(y, z)) return light;
        }
        return kNone;
    }
};

AMBILUX_HD VplSearch VplSource::search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z, uint32_t max_depth,
                                       uint32_t) const {
    return {*this, key, depth, z, max_depth};
}

}  // namespace ambilux
