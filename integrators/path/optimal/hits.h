// Notes of the emitters that rays hit.
#pragma once

#include "integrators/path/optimal/records.h"
#include "stages/stage.h"
#include "transport/mis/heuristic.h"
#include "transport/subpath/emission.h"

namespace ambilux {

/// Over the hits of a depth. The vertex stage weighs and adds the same light.
template <Features F, class Mis>
struct NoteHits {
    static constexpr const char* kName = "optimal_hits";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Rules<Mis> rules;
    Queue<HitItem<typename Items::Ray>> hits;
    EmitterStrategies strategies;
    StrategyRecords records;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const HitItem<typename Items::Ray> h = hits.load(i);
        const uint32_t place = records.place(h.ray.path, h.ray.bits.depth() - 1);
        if (place == kNone || !records.has_vertex(place)) return;
        Candidate<Mis> c;
        uint32_t emitter;
        if (!light(h, c, emitter) || !is_valid_radiance(c.value)) return;
        const float weight = mis_weight(c.ratio);
        records.found_by_hit(place, {c.value * weight, 1.0f - weight}, strategies.of(emitter));
    }

private:
    AMBILUX_HD bool light(const HitItem<typename Items::Ray>& h, Candidate<Mis>& c, uint32_t& emitter) const {
        const Subpath<Mis> path = Items::unpack(h.ray);
        if (h.prim == kNone) {
            emitter = scene.environment;
            return escape<F>(scene, rules, path, c);
        }
        const SurfacePoint point = surface_at<F>(scene, h.prim, h.u, h.v);
        emitter = scene.shapes[point.shape].emitter;
        return emission<F>(scene, rules, path, point, c);
    }
};

}  // namespace ambilux
