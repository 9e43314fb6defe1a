// Light vertices of a wave are kept, appended to those of all waves, and put in the order of their cells.
#pragma once

#include "integrators/bdpt/shared/subpath_number.h"
#include "integrators/bdpt/vcm/grid.h"
#include "integrators/bdpt/vcm/policy.h"
#include "stages/stage.h"
#include "transport/subpath/visit.h"

namespace ambilux {

/// The radius of the iterations at work (Knaus and Zwicker 2011).
struct SetRadius {
    static constexpr const char* kName = "set_radius";

    const WaveState* state;
    MergeNow* now;
    float first;  ///< of the first iteration
    float alpha;
    float light_subpaths;  ///< of an iteration
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t) const {
        const float r = first * powf(float(RadiusStep::of(state->iteration).first + 1), 0.5f * (alpha - 1.0f));
        *now = {r, kPi * r * r * light_subpaths};
    }
};

/// Calls `use` with the vertex where a subpath hit, if a merge there would be part of a path that counts.
template <Features F, class Mis, class Use>
AMBILUX_HD void at_mergeable(const SceneView& scene, const Rules<Mis>& rules, Side side,
                             const HitItem<typename SubpathItems<Mis>::Ray>& h, Use use) {
    if (h.prim == kNone) return;
    const Subpath<Mis> path = SubpathItems<Mis>::unpack(h.ray);
    if (path.depth >= rules.max_depth) return;
    const Vertex<Mis> vertex = vertex_at<F>(scene, rules, side, path, surface_at<F>(scene, h.prim, h.u, h.v));
    if (bsdf_is_smooth(vertex.scattering.bsdf)) use(path, vertex);
}

/// Vertices of light subpaths where merges and connections may end, one for each hit.
template <Features F, class Mis = MergingMis>
struct KeepVertices {
    static constexpr const char* kName = "keep_vertices";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<HitItem<typename Items::Ray>> hits;
    VcmVerticesOf<Mis> kept;
    const MergeNow* now;
    IterationNumbers numbers;
    MergeKeys keys;
    bool connects;
    bool keeps_first;  ///< else next event estimation finds what arrives from emitters, beams excepted
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const auto hit = hits.load(i);
        at_mergeable<F>(scene, rules, Side::light, hit, [&](const Subpath<Mis>& path, const Vertex<Mis>& y) {
            if (keeps_first || path.depth > 1 || is_beam(scene.emitters[path.start.emitter].type))
                keep(hit.ray.path, path, y);
        });
    }

private:
    AMBILUX_HD void keep(uint32_t slot, const Subpath<Mis>& path, const Vertex<Mis>& y) const {
        const uint32_t place = kept.merges.push(MergeVertexOf<Mis>::make({y.point.p, path.depth}, path.throughput,
                                                                         octahedral_encode(path.direction), y.sums));
        if (place >= kept.merges.capacity()) return;
        const uint32_t cell = MergeGrid::of(scene, now->radius).cell(y.point.p).hash(keys.table_bits);
        kept.keys[place] =
            keys.key(keys.place(numbers.iteration(wave, slot), cell), numbers.light_subpath(wave, slot), path.depth);
        if (!connects) return;
        const auto vertex = pack_connection_vertex(y, path, kNone);
        kept.connections.store(place, vertex, lanes_of<F>(vertex));
    }
};

/// Those of a wave become vertices of all.
template <class Mis = MergingMis>
struct AppendVertices {
    static constexpr const char* kName = "append_vertices";

    VcmVerticesOf<Mis> mine;
    VcmStateOf<Mis> state;
    StageRecord* record;

    const Queue<MergeVertexOf<Mis>>& items() const { return mine.merges; }
    QueueCounter* target() const { return state.all.merges.counter; }

    AMBILUX_HD void operator()(uint32_t i, uint32_t place) const {
        state.all.merges.store(place, mine.merges.load(i));
        state.order.keys[0][place] = mine.keys[i];
        state.order.values[0][place] = place;
        if (mine.connections.capacity > 0)
            state.all.connections.store(place, mine.connections.load(i, state.lanes), state.lanes);
    }
};

/// Where the vertices of each place in the tables start, once keys are sorted. Over one item more than there are.
template <class Mis = MergingMis>
struct FindCells {
    static constexpr const char* kName = "find_cells";

    VcmStateOf<Mis> state;
    const WaveState* wave;
    uint32_t samples;  ///< of an iteration
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint64_t* keys = state.order.keys[1];
        const uint32_t count = state.all.merges.counter->size();
        const uint32_t first = i > 0 ? state.keys.place(keys[i - 1]) + 1 : 0;
        const uint32_t end = state.keys.place(wave->samples / samples, 0);
        const uint32_t last = i < count ? state.keys.place(keys[i]) : end;
        for (uint32_t place = first; place <= last; ++place) state.starts[place] = i;
    }
};

/// Vertices go to their places in the order of keys.
template <class Mis = MergingMis>
struct PlaceVertices {
    static constexpr const char* kName = "place_vertices";

    VcmStateOf<Mis> state;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t from = state.order.values[1][i];
        state.sorted.store(i, state.all.merges.load(from));
        if (state.sorted_connections.capacity > 0)
            state.sorted_connections.store(i, state.all.connections.load(from, state.lanes), state.lanes);
    }
};

}  // namespace ambilux
