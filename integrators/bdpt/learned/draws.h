// Draws from a cache of light vertices that follow what light vertices have brought to eye vertices in earlier waves
// (after Su, Li and Wang 2022, SPCBPT: Subspace-based Probabilistic Connections for Bidirectional Path Tracing). Eye
// vertices lie in cells, light vertices in clusters, and a table tells how a cell draws among clusters. What a draw
// brings is divided by the probability of its vertex, so that the expectation is that of uniform draws, whatever the
// table holds.
#pragma once

#include "core/atomic.h"
#include "integrators/bdpt/learned/draw_tree.h"
#include "integrators/bdpt/learned/scored_items.h"
#include "queues/primitives.h"
#include "stages/arrival.h"
#include "stages/light_vertex_search.h"
#include "transport/mis/heuristic.h"

namespace ambilux {

/// What is learned, kept from wave to wave. A row of `tickets` holds how many of kTickets fall to a cluster or to those
/// before it; those that are left draw from all vertices alike.
struct DrawTable {
    static constexpr uint32_t kTickets = 1u << 16;

    DrawTree cells, clusters;
    uint16_t* tickets;   ///< [cell][cluster]
    int64_t* sums;       ///< [cell][cluster]: scores, in integers, so that they may be added up in any order
    float inverse_unit;  ///< of scores

    AMBILUX_HD uint32_t row(uint32_t cell) const { return cell << clusters.levels; }
};

/// Scores of shadow rays that are free are added to the table.
struct LearnDraws {
    using Item = ScoredShadowItem;
    using Candidate = ScoredCandidate;

    int64_t* sums;

    AMBILUX_HD static ShadowItem ray(const ScoredShadowItem& item) { return item.ray(); }
    AMBILUX_HD void arrive(const ScoredShadowItem& item) const {
        if (item.score.entry != kNone) fetch_add_shared(sums + item.score.entry, int64_t(item.score.value));
    }
};

/// The light vertices of a wave by clusters.
struct ClusteredVertices {
    static constexpr uint32_t kParts = 16;
    static constexpr uint32_t kPartBits = 4;

    uint32_t* first;            ///< by cluster: in `sorted`; one more at the end
    SortMemory<uint16_t> sort;  ///< light vertices by their keys

    /// Of a light vertex. Within a cluster vertices lie in parts, which decides nothing but which of them a random
    /// number finds: images stay as they were.
    AMBILUX_HD static uint16_t key(uint32_t cluster, uint32_t vertex) {
        return uint16_t(cluster << kPartBits | (vertex / 32 & (kParts - 1)));
    }
    AMBILUX_HD uint32_t cluster(uint32_t vertex) const { return sort.keys[0][vertex] >> kPartBits; }
    AMBILUX_HD uint32_t sorted(uint32_t place) const { return sort.values[1][place]; }
};

struct LearnedSearch;

/// LightVertexSource.
struct LearnedSource {
    using Mis = BidirectionalMis;
    using Learn = LearnDraws;

    LightVertices<Mis> vertices;
    uint32_t draws;
    ClusteredVertices by_cluster;
    DrawTable table;

    AMBILUX_HD uint32_t first(uint32_t) const { return draws; }
    AMBILUX_HD LearnDraws learn() const { return {table.sums}; }
    /// The cell of an eye vertex.
    AMBILUX_HD uint32_t link(const BidirectionalVertex& v, uint32_t) const {
        const Vec3f ng = v.scattering.ng;
        return table.cells.leaf(v.point.p, dot(ng, v.scattering.wi_world) < 0.0f ? -ng : ng);
    }
    AMBILUX_HD LearnedSearch search(const RngKey& key, uint32_t depth, const BidirectionalVertex& z, uint32_t max_depth,
                                    uint32_t cell) const;
};

/// A light vertex that an eye vertex of `cell` has drawn.
struct LearnedDraw {
    const LearnedSource& source;
    uint32_t cell, cluster, place;

    AMBILUX_HD bool from_cache() const { return true; }
    /// One over the probability of the vertex in a draw.
    AMBILUX_HD float inverse_probability() const {
        const uint16_t* row = source.table.tickets + source.table.row(cell);
        const uint32_t* first = source.by_cluster.first + cluster;
        const uint32_t own = row[cluster] - (cluster > 0 ? row[cluster - 1] : 0);
        const float all = float(DrawTable::kTickets - row[source.table.clusters.leaves() - 1]) /
                          float(source.vertices.counter->size());
        return float(DrawTable::kTickets) / (all + float(own) / float(first[1] - first[0]));
    }
    AMBILUX_HD float scale(const WaveState& state) const {
        return inverse_probability() / (float(state.light_subpaths) * float(source.draws));
    }
    /// What is to be learned from `c`, whose value is not scaled yet: the second moment of what this draw would bring
    /// if its cluster were certain, without the throughput of the eye subpath. The least variance has draws in
    /// proportion to its root. Of a wave of many subpaths, the vertices of some train for all.
    AMBILUX_HD Score note(const Candidate<BidirectionalMis>& c, Rgb throughput, const WaveState& state) const;

private:
    static constexpr uint32_t kTrainingSubpaths = 1u << 20;  ///< of a wave, whose vertices are learned from
};

/// LightVertexSearch.
struct LearnedSearch {
    const LearnedSource& source;
    const RngKey& key;
    uint32_t depth;
    const BidirectionalVertex& z;
    uint32_t max_depth, cell;

    AMBILUX_HD LearnedDraw draw(uint32_t place) const {
        return {source, cell, source.by_cluster.cluster(place), place};
    }

    AMBILUX_HD uint32_t find(uint32_t& next) const {
        const uint32_t size = source.vertices.counter->size();
        if (size == 0 || depth + 2 > max_depth) next = kNone;
        while (next != kNone) {
            const uint32_t light = drawn(--next, size);
            if (next == 0) next = kNone;
            if (light == kNone) continue;
            const ConnectionVertexFront y = source.vertices.items.load_front(light);
            if (depth + y.bits.depth() + 1 <= max_depth && may_connect(y, z)) return light;
        }
        return kNone;
    }
    /// What draw number `draw` finds of `size` light vertices; kNone: a cluster without vertices. The tickets of all
    /// draws of an eye vertex are stratified.
    AMBILUX_HD uint32_t drawn(uint32_t draw, uint32_t size) const {
        const Uint4 u = cache_draw(key, depth, draw);
        const uint32_t clusters = source.table.clusters.leaves();
        const uint16_t* row = source.table.tickets + source.table.row(cell);
        const uint32_t ticket = uint32_t(((uint64_t(draw) << 32 | u.y) / source.draws) >> 16);
        if (ticket >= row[clusters - 1]) return mul_hi(u.x, size);
        uint32_t cluster = 0;
        for (uint32_t step = clusters / 2; step > 0; step /= 2)
            if (row[cluster + step - 1] <= ticket) cluster += step;
        const uint32_t* first = source.by_cluster.first + cluster;
        const uint32_t count = first[1] - first[0];
        return count > 0 ? source.by_cluster.sorted(first[0] + mul_hi(u.x, count)) : kNone;
    }
};

AMBILUX_HD LearnedSearch LearnedSource::search(const RngKey& key, uint32_t depth, const BidirectionalVertex& z,
                                               uint32_t max_depth, uint32_t cell) const {
    return {*this, key, depth, z, max_depth, cell};
}

AMBILUX_HD Score LearnedDraw::note(const Candidate<BidirectionalMis>& c, Rgb throughput, const WaveState& state) const {
    const DrawTable& table = source.table;
    const uint32_t each = 1 + state.light_subpaths / kTrainingSubpaths;  // of so many vertices one is looked at
    if (place % each != 0) return {};
    const uint32_t* first = source.by_cluster.first + cluster;
    const float y = luminance(c.value) * mis_weight(c.ratio) / luminance(throughput);
    const float n = float(first[1] - first[0]), N = float(state.light_subpaths);
    float score = y * inverse_probability() / (N * float(source.draws));  // of a light subpath
    score *= y * n / N * table.inverse_unit * float(each);
    if (!(score >= 1.0f)) return {};
    return {table.row(cell) + cluster, score < 0x1p44f ? score : 0x1p44f};
}

}  // namespace ambilux
