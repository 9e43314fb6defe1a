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
            by.place[i] = fetch_add(by.counts + by.part(i));
        }
    }
};

/// Where the vertices of each cluster, and of each part of it, begin.
struct PlaceClusters {
    static constexpr const char* kName = "sort_light_vertices";

    LearnedSource source;
    StageRecord* record;

    AMBILUX_HD void run(uint32_t begin, uint32_t, uint32_t step) const {
        constexpr uint32_t kParts = ClusteredVertices::kParts;
        const ClusteredVertices& by = source.by_cluster;
        const uint32_t clusters = source.table.clusters.leaves();
        uint32_t first = 0, part = 0;
        for (uint32_t k = begin; k < clusters; k += step) {
            for (; part < k * kParts; ++part) first += by.counts[part];
            by.first[k] = first;
            for (; part < (k + 1) * kParts; ++part) {
                by.starts[part] = first;
                first += by.counts[part];
            }
            if (k + 1 == clusters) by.first[clusters] = first;
        }
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
            by.sorted[by.starts[by.part(i)] + by.place[i]] = i;
        for (uint32_t part = begin, n = source.table.clusters.leaves() * ClusteredVertices::kParts; part < n;
             part += step)
            by.counts[part] = 0;  // for the next wave
    }
};

}  // namespace ambilux
