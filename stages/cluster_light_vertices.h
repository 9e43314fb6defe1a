// sort_light_vertices: light vertices by clusters, for learned draws: counted, then given their places.
#pragma once

#include "stages/learned_draws.h"

namespace ambilux {

/// Counts how many vertices a cluster has.
struct CountClusters {
    static constexpr const char* kName = "sort_light_vertices";

    LearnedSource source;
    StageRecord* record;

    AMBILUX_HD void run(uint32_t begin, uint32_t, uint32_t step) const {
        const ClusteredVertices& by = source.by_cluster;
        for (uint32_t i = begin, n = source.vertices.counter->size(); i < n; i += step) {
            const ConnectionVertexFront v = source.vertices.items.load_front(i);
            const Vec3f ng = octahedral_direction(v.ng);
            const uint32_t cluster = source.table.clusters.leaf(v.p, v.bits.reaches(ng, ng) ? ng : -ng);
            by.cluster[i] = uint16_t(cluster);
            by.place[i] = fetch_add(by.counts + cluster);
        }
    }
};

/// Where the vertices of each cluster begin. One thread.
struct PlaceClusters {
    static constexpr const char* kName = "sort_light_vertices";

    LearnedSource source;
    StageRecord* record;

    AMBILUX_HD void run(uint32_t begin, uint32_t, uint32_t) const {
        if (begin > 0) return;
        const ClusteredVertices& by = source.by_cluster;
        uint32_t first = 0;
        for (uint32_t k = 0; k < source.table.clusters.leaves(); ++k) {
            by.first[k] = first;
            first += by.counts[k];
            by.counts[k] = 0;
        }
        by.first[source.table.clusters.leaves()] = first;
    }
};

/// Puts vertices at their places.
struct SortByCluster {
    static constexpr const char* kName = "sort_light_vertices";

    LearnedSource source;
    StageRecord* record;

    AMBILUX_HD void run(uint32_t begin, uint32_t, uint32_t step) const {
        const ClusteredVertices& by = source.by_cluster;
        for (uint32_t i = begin, n = source.vertices.counter->size(); i < n; i += step)
            by.sorted[by.first[by.cluster[i]] + by.place[i]] = i;
    }
};

}  // namespace ambilux
