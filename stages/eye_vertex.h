// shade and connect: a vertex of an eye subpath, and next event estimation there (s = 1).
#pragma once

#include "stages/fused_clock.h"
#include "stages/stage.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/visit.h"

namespace ambilux {

/// At an eye vertex. `Out` takes candidates.
template <Features F, class Mis, class Out>
struct NextEvent {
    Out candidates;
    StageRecord* record;
    bool seeds;  ///< shadow rays need a seed: surfaces of partial opacity, culling

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>& numbers) const {
        Candidate<Mis> c;
        if (next_event<F>(scene, rules, v, path.throughput, path.depth, numbers.next_event(path.depth), c) &&
            is_valid_radiance(c.value, record))
            candidates.push(pack_candidate(c, slot, seeds ? numbers.shadow_seed(path.depth) : 0));
    }
};

/// What is done at a vertex (NextEvent, ConnectCamera), with its items and its time in the record of the stage that it
/// is elsewhere. On a host alone.
template <class AtVertex>
struct Clocked {
    AtVertex inner;

    template <class Mis>
    void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
            uint32_t slot, const NumbersOf<Mis>& numbers) const {
        inner.record->count_item(path.depth);
        const FusedClock clock(inner.record, true);
        inner.at(scene, rules, v, path, slot, numbers);
    }
};

/// Vertices wait in a queue for the stage that connects them.
template <Features F, class Mis>
struct QueueVertex {
    Queue<VertexItem<Mis>> vertices;

    AMBILUX_HD void at(const SceneView&, const Rules<Mis>&, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>&) const {
        push_vertex<F>(vertices, pack_vertex(v, path, slot));
    }
};

/// What the vertex meets goes to `EmissionOut`, what may be connected to `AtVertex`.
template <Features F, class Mis, class EmissionOut, class AtVertex>
struct EyeVertex {
    static constexpr const char* kName = "shade";
    using Items = SubpathItems<Mis>;
    using RayItem = typename Items::Ray;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<HitItem<RayItem>> hits;
    Queue<RayItem> rays;
    EmissionOut emission;
    AtVertex vertices;
    StageRecord* record;
    bool camera_lane_known;  ///< camera rays lie without the lane that all of them share

    AMBILUX_HD const Queue<HitItem<RayItem>>& items() const { return hits; }
    /// True if misses contribute nothing.
    AMBILUX_HD bool skips_misses() const {
        return !F.has_environment() || scene.environment == kNone || !rules.count_environment;
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        RayItem next;
        if (step(hit(i), next)) rays.push(next);
    }
    AMBILUX_HD HitItem<RayItem> hit(uint32_t i) const {
        if constexpr (requires { RayItem::kCameraLane; }) {
            constexpr uint32_t kOne = 0x3f800000u, kNoLane = LaneArray<HitItem<RayItem>>::kLanes;
            const uint32_t known = camera_lane_known && wave.state->depth == 1 ? RayItem::kCameraLane : kNoLane;
            return hits.items.load_but(i, known, {{kOne, kOne, kOne, kOne}});
        } else {
            return hits.load(i);
        }
    }

    /// Where the results of the vertex go.
    struct Sink {
        const EyeVertex& stage;
        uint32_t slot;

        AMBILUX_HD NumbersOf<Mis> numbers() const { return eye_numbers(stage.rules.mis, stage.wave, slot); }
        AMBILUX_HD void add(const Candidate<Mis>& c) const {
            if (is_valid_radiance(c.value, stage.record))
                stage.emission.push(EmissionItem{c.value, slot, c.ratio, c.strategy, {}});
        }
        AMBILUX_HD void at(const Vertex<Mis>& v, const Subpath<Mis>& path, const NumbersOf<Mis>& numbers) const {
            if (stage.rules.next_event || stage.rules.connect)
                stage.vertices.at(stage.scene, stage.rules, v, path, slot, numbers);
        }
        AMBILUX_HD bool valid(Rgb throughput) const { return is_valid_radiance(throughput, stage.record); }
    };

    /// True if the subpath goes on with the ray `next`.
    AMBILUX_HD bool step(const HitItem<RayItem>& h, RayItem& next) const {
        Subpath<Mis> path = Items::unpack(h.ray);
        if (!visit<F>(scene, rules, Side::eye, rules.longest(Side::eye), h.hit(), path, Sink{*this, h.ray.path}))
            return false;
        next = Items::pack(path, Side::eye, h.ray.path, kInfinity);
        return true;
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
        connect.at(scene, rules, end.vertex, path, item.path, eye_numbers(rules.mis, wave, item.path));
    }
};

}  // namespace ambilux
