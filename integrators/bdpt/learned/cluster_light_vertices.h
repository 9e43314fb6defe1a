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
        const uint16_t* keys = source.by_cluster.sort.keys[1];
        uint32_t begin = 0, end = source.vertices.counter->size();
        while (begin < end) {
            const uint32_t middle = begin + (end - begin) / 2;
            if (keys[middle] >> ClusteredVertices::kPartBits < cluster)
                begin = middle + 1;
            else
                end = middle;
        }
        source.by_cluster.first[cluster] = begin;
    }
};

}  // namespace ambilux
