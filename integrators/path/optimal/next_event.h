// Next event estimation that leaves a note of what it found.
#pragma once

#include "integrators/path/optimal/records.h"
#include "stages/arrival.h"
#include "stages/eye_vertex.h"

namespace ambilux {

/// A candidate and the place of its vertex in StrategyRecords.
struct PlacedCandidate {
    CandidateItem candidate;
    uint32_t place;
    uint32_t pad[3];

    AMBILUX_HD uint32_t path() const { return candidate.path; }
};

struct PlacedShadowItem : ShadowItem {
    uint32_t place;
    float other;  ///< FoundLight
    uint32_t pad[2];
};

AMBILUX_HD const CandidateItem& plain(const PlacedCandidate& c) { return c.candidate; }
AMBILUX_HD void make_shadow(const PlacedCandidate& c, Rgb value, PlacedShadowItem& item) {
    make_shadow(c.candidate, value, static_cast<ShadowItem&>(item));
    item.place = c.place;
    item.other = 1.0f - mis_weight(c.candidate.ratio);
}

/// Notes shadow rays that are free (Occlude).
struct NoteNextEvents {
    using Item = PlacedShadowItem;
    using Candidate = PlacedCandidate;

    StrategyRecords records;

    AMBILUX_HD static const ShadowItem& ray(const PlacedShadowItem& item) { return item; }
    AMBILUX_HD void arrive(const PlacedShadowItem& item) const {
        if (item.place != kNone) records.found_by_next_event(item.place, {item.value, item.other});
    }
};

/// How a vertex samples emitters here.
struct OptimalSampling {
    OptimalSettings settings;
    EmitterStrategies strategies;
    StrategyRecords records;

    static OptimalSampling plan(const RenderSettings& all) { return {OptimalSettings::plan(all), {}, {}}; }
    NoteNextEvents learn() const { return {records}; }
};

/// At an eye vertex, in the place of NextEvent. `Out` takes candidates.
template <Features F, class Mis, class Out>
struct OptimalNextEvent {
    Out candidates;
    StageRecord* record;
    bool seeds;  ///< shadow rays need a seed
    OptimalSampling sampling;

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>& numbers) const {
        if (!rules.next_event) return;
        const Vec4f u = numbers.next_event(path.depth);
        const uint32_t place = sampling.records.place(slot, path.depth);
        if (place != kNone) {
            const float scale = luminance(path.throughput);
            if (scale > 0.0f && scale < kInfinity)
                sampling.records.begin(
                    place, scale, sampling.strategies.of(rules.lights.pick(scene, {v.point.p, v.point.ng}, u).emitter));
        }
        Candidate<Mis> c;
        if (!next_event<F>(scene, rules, v, path.throughput, path.depth, u, c)) return;
        if (c.environment) {  // what is learned must know its radiance
            c.environment = false;
            c.value *= environment_radiance<F>(scene, c.direction);
            if (is_zero(c.value)) return;
        }
        if (is_valid_radiance(c.value, record))
            candidates.push(
                PlacedCandidate{pack_candidate(c, slot, seeds ? numbers.shadow_seed(path.depth) : 0), place, {}});
    }
};

}  // namespace ambilux
