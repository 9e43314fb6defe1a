// The light vertices of an iteration, in the order of their light subpaths: left by those of all waves, appended,
// sorted.
#pragma once

#include "integrators/bdpt/shared/subpath_number.h"
#include "integrators/bdpt/vpl/policy.h"
#include "integrators/kept_state.h"
#include "stages/generate.h"

namespace ambilux {

/// Keys put light vertices in the order of light subpath and depth, which knows nothing of waves and threads.
AMBILUX_HD uint32_t light_vertex_key(uint32_t subpath, uint32_t depth) { return subpath << kDepthBits | depth; }
static_assert((VplSettings::kMostSubpaths - 1) <= ~0u >> kDepthBits);

/// What lives as long as an iteration.
struct VplState {
    static constexpr StateKind kKind = StateKind::by_index;

    LightVertices<VplMis> all;                   ///< as they were appended
    LaneArray<ConnectionVertex<VplMis>> sorted;  ///< in the order of keys
    SortMemory<uint32_t> order;                  ///< keys and places
    uint32_t lanes;                              ///< of a vertex

    static VplState lay_out(Layout& layout, const VplPolicy& p, const StateSize& size) {
        const uint32_t n = p.keeps_vertices ? size.appended : 0;
        VplState s;
        s.all = layout.growing_queue<ConnectionVertex<VplMis>>("set_vertices", n, p.vertex_lanes);
        s.sorted = layout.array<ConnectionVertex<VplMis>>(n, p.vertex_lanes);
        s.order = SortMemory<uint32_t>::lay_out(layout, n, size.primitives);
        s.lanes = p.vertex_lanes;
        return s;
    }
    AMBILUX_HD LightVertices<VplMis> in_order() const {
        LightVertices<VplMis> q;
        q.items = sorted;
        q.counter = all.counter;
        return q;
    }

    template <class Policy, class Put>
    void init(const Policy&, Put) const {}
    template <class Visit>
    void for_each_saved(Visit) const {}
    /// Of `old`, which had too little room.
    template <class Copy>
    void take_items(const VplState& old, uint32_t items, Copy copy) const {
        take_lanes(all.items, old.all.items, lanes, items, copy);
        copy(order.keys[0], old.order.keys[0], items);
        copy(order.values[0], old.order.values[0], items);
    }
};

/// The first `subpaths` light subpaths that an iteration's slots have room for.
template <Features F>
struct GenerateSet {
    using Generate = GenerateLight<F, VplMis, Queue<CandidateItem>>;
    static constexpr const char* kName = Generate::kName;

    Generate generate;
    IterationNumbers numbers;
    uint32_t subpaths;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (numbers.light_subpath(generate.wave, slot) < subpaths) generate(slot);
    }
};

/// At a vertex of a light subpath, in the place of a connection with the camera.
template <Features F>
struct KeepVertex {
    LightVertices<VplMis> vertices;
    Wave wave;
    IterationNumbers numbers;

    AMBILUX_HD void at(const SceneView&, const Rules<VplMis>&, const Vertex<VplMis>& y, const Subpath<VplMis>& path,
                       uint32_t slot, const RandomNumbers&) const {
        push_vertex<F>(vertices, pack_connection_vertex(y, path, numbers.light_subpath(wave, slot)));
    }
};

/// Light vertices of a wave become vertices of all.
struct AppendToSet {
    static constexpr const char* kName = "append_vertices";

    LightVertices<VplMis> mine;
    VplState state;
    StageRecord* record;

    const LightVertices<VplMis>& items() const { return mine; }
    QueueCounter* target() const { return state.all.counter; }

    AMBILUX_HD void operator()(uint32_t i, uint32_t place) const {
        const ConnectionVertex<VplMis> y = mine.items.load(i, state.lanes);
        state.all.items.store(place, y, state.lanes);
        state.order.keys[0][place] = light_vertex_key(y.front.link, y.front.bits.depth());
        state.order.values[0][place] = place;
    }
};

/// They go to their places in the order of keys.
struct PlaceInSet {
    static constexpr const char* kName = "place_vertices";

    VplState state;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        state.sorted.store(i, state.all.items.load(state.order.values[1][i], state.lanes), state.lanes);
    }
};

}  // namespace ambilux
