// sort_light_vertices: light vertices of a wave by clusters, for learned draws.
#pragma once

#include "integrators/bdpt/learned/draws.h"

namespace ambilux {

/// The key of each light vertex; the executor sorts them.
struct KeyByCluster {
    static constexpr const char* kName = "sort_light_vertices";

    LearnedSource source;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const ConnectionVertexFront v = source.vertices.items.load_front(i);
        const Vec3f ng = octahedral_direction(v.ng);
        const uint32_t cluster = source.table.clusters.leaf(v.p, v.bits.reaches(ng, ng) ? ng : -ng);
        source.by_cluster.sort.keys[0][i] = ClusteredVertices::key(cluster, i);
        source.by_cluster.sort.values[0][i] = i;
    }
};

/// Where the vertices of each cluster begin, and where the last end.
struct FindClusters {
    static constexpr const char* kName = "sort_light_vertices";

    LearnedSource source;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t cluster) const {
        source.by_cluster.first[cluster] = lower_bound(source.by_cluster.sort.keys[1], source.vertices.counter->size(),
                                                       ClusteredVertices::key(cluster, 0));
    }
};

}  // namespace ambilux
