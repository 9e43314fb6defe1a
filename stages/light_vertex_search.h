// Which light vertices an eye vertex is connected with: those of the light subpath of its slot, or drawn from a cache
// of those of all light subpaths of the wave (Davidovic et al. 2014).
#pragma once

#include "core/warp.h"
#include "stages/arrival.h"
#include "stages/cache_draw.h"
#include "stages/stage.h"

namespace ambilux {

template <class Mis>
struct LightVertexSearch;

/// The light vertices of a wave.
template <class MisModel>
struct LightVertexSource {
    using Mis = MisModel;
    using Learn = LearnNothing;

    LightVertices<Mis> vertices;
    const uint32_t* last_vertex;  ///< per slot: of its light subpath. Not used by draws
    uint32_t draws;               ///< of an eye vertex from all vertices; 0: those of the light subpath of its slot
    bool coherent;                ///< lanes of a warp draw vertices that lie together; else each draws by itself

    /// Where a search starts; kNone: there is nothing to connect with.
    AMBILUX_HD uint32_t first(uint32_t slot) const { return draws > 0 ? draws : last_vertex[slot]; }

    AMBILUX_HD bool from_cache() const { return draws > 0; }
    AMBILUX_HD static NoNote note(const Candidate<Mis>&, Rgb, const WaveState&) { return {}; }
    static LearnNothing learn() { return {}; }
    /// What the queue of eye vertices keeps of the vertex `v` of a slot (ConnectionVertexFront::link).
    AMBILUX_HD static uint32_t link(const Vertex<Mis>&, uint32_t slot) { return slot; }
    AMBILUX_HD LightVertexSearch<Mis> search(const RngKey& key, uint32_t depth, const Vertex<Mis>& z,
                                             uint32_t max_depth, uint32_t) const {
        return {*this, key, depth, z, max_depth};
    }

    /// What a connection is worth: M vertices of N subpaths are in a cache, and k draws estimate the sum over a
    /// subpath's vertices by M / (N k) times theirs.
    AMBILUX_HD float scale(const WaveState& state) const {
        if (draws == 0) return 1.0f;
        return float(vertices.counter->size()) / (float(state.light_subpaths) * float(draws));
    }
};

/// Which of `size` light vertices a draw of the eye vertex at `depth`, one of `draws`, finds, each with the same
/// probability. Coherent draws begin at one random place of the cache for all lanes: so does what they load, and mostly
/// it was left by light subpaths on one material.
template <class Points = IndependentPoints>
AMBILUX_HD uint32_t drawn_vertex(RngKey key, uint32_t depth, uint32_t draw, uint32_t size, bool coherent,
                                 uint32_t draws = kMaxCacheDraws) {
    if (!coherent) return mul_hi(cache_draw<Points>(key, depth, draw, draws).x, size);
    const Warp warp;
    key.index = warp.first(key.index);
    key.sample = warp.first(key.sample);
    const uint32_t begin = mul_hi(cache_draw<Points>(key, warp.first(depth), warp.first(draw), draws).x, size),
                   at = begin + warp.rank();
    return at < size ? at : at % size;
}

/// Goes through the light vertices that an eye vertex may be connected with.
template <class Mis>
struct LightVertexSearch {
    const LightVertexSource<Mis>& source;
    const RngKey& key;  ///< of the eye subpath
    uint32_t depth;     ///< of the eye vertex `z`
    const Vertex<Mis>& z;
    uint32_t max_depth;  ///< of a path

    /// How the light vertex at `place` was found.
    AMBILUX_HD const LightVertexSource<Mis>& draw([[maybe_unused]] uint32_t place) const { return source; }

    /// The next one, kNone if there is none, from `next` on, which goes on: a vertex of the light subpath of the same
    /// slot, or, over a cache, the number of draws that are left.
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        const bool drawn = source.draws > 0;
        const uint32_t size = source.vertices.counter->size();
        if (size == 0 || depth + 2 > max_depth) next = kNone;
        while (next != kNone) {
            uint32_t light = next;
            if (drawn)
                light = drawn_vertex<typename NumbersOf<Mis>::Points>(key, depth, --next, size, source.coherent,
                                                                      source.draws);
            const ConnectionVertexFront y = source.vertices.items.load_front(light);
            if (!drawn)
                next = y.link;
            else if (next == 0)
                next = kNone;
            if (depth + y.bits.depth() + 1 <= max_depth && may_connect(y, z)) return light;
        }
        return kNone;
    }
};

}  // namespace ambilux
