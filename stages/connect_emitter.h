// connect: an eye vertex samples an emitter (next event estimation, s = 1).
#pragma once

#include "stages/stage.h"
#include "transport/subpath/next_event.h"

namespace ambilux {

/// At an eye vertex. `Out` takes candidates.
template <Features F, class Mis, class Out>
struct NextEvent {
    Out candidates;
    StageRecord* record;
    bool seeds;  ///< shadow rays need a seed: surfaces of partial opacity, culling

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const Draws& draws) const {
        Candidate<Mis> c;
        if (next_event<F>(scene, rules, v, path.throughput, path.depth, draws.next_event(path.depth), c) &&
            is_valid_radiance(c.value, record))
            candidates.push(pack_candidate(c, slot, seeds ? draws.shadow_seed(path.depth) : 0));
    }
};

/// What an eye vertex does, over vertices that wait in a queue.
template <Features F, class Mis, class AtVertex>
struct ConnectEmitter {
    static constexpr const char* kName = "connect";

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<VertexItem<Mis>> vertices;
    AtVertex connect;
    StageRecord* record;

    const Queue<VertexItem<Mis>>& items() const { return vertices; }
    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem<Mis> item = load_vertex<F>(vertices, i);
        const SubpathEnd<Mis> end = unpack_end<F>(scene, item);
        Subpath<Mis> path{};
        path.direction = item.d;
        path.throughput = end.throughput;
        path.depth = end.depth;
        connect.at(scene, rules, end.vertex, path, item.path, {wave.key(item.path)});
    }
};

}  // namespace ambilux
