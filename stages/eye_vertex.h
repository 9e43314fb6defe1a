// shade: a vertex of an eye subpath. What it meets goes to `EmissionOut`, what may be connected to `AtVertex`.
#pragma once

#include "stages/stage.h"
#include "transport/subpath/visit.h"

namespace ambilux {

/// Vertices wait in a queue for the stage that connects them.
template <Features F, class Mis>
struct QueueVertex {
    Queue<VertexItem<Mis>> vertices;

    AMBILUX_HD void at(const SceneView&, const Rules<Mis>&, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const Draws&) const {
        push_vertex<F>(vertices, pack_vertex(v, path, slot));
    }
};

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

        AMBILUX_HD Draws draws() const { return {stage.wave.key(slot)}; }
        AMBILUX_HD void add(const Candidate<Mis>& c) const {
            if (is_valid_radiance(c.value, stage.record))
                stage.emission.push(EmissionItem{c.value, slot, c.ratio, c.strategy, {}});
        }
        AMBILUX_HD void at(const Vertex<Mis>& v, const Subpath<Mis>& path, const Draws& draws) const {
            if (stage.rules.next_event || stage.rules.connect)
                stage.vertices.at(stage.scene, stage.rules, v, path, slot, draws);
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

}  // namespace ambilux
