#include "integrators/path/policy.h"

#include <algorithm>

namespace ambilux {

namespace {

/// True if next event estimation finds light of any emitter.
bool samples_emitters(const Scene& scene) {
    return std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return !is_beam(e.type); });
}

}  // namespace

PathPolicy plan_path(const Scene& scene, const RenderSettings& settings) {
    check_depths(settings);
    PathPolicy p{};
    Rules<UnidirectionalMis>& r = p.rules;
    r.max_depth = segment_limit(settings);
    r.rr_depth = roulette_depth(settings);
    r.rr_cap = settings.rr_cap;
    r.next_event = samples_emitters(scene) && settings.estimator != Estimator::naive && r.max_depth >= 2;
    r.mis = {settings.estimator, settings.heuristic, r.next_event};
    r.count_hits =
        std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return !is_delta(e.type); });
    r.count_environment = scene.environment != kNone;
    r.hide_emitters = scene.integrator.hide_emitters;
    p.waves.queues = settings.queues;
    p.waves.cull = settings.cull;
    p.waves.deterministic = settings.deterministic;
    return p;
}

std::vector<std::string> skipped_path_parts(const Scene& scene, const Rules<UnidirectionalMis>& r) {
    std::vector<std::string> parts;
    if (!r.next_event)
        parts.emplace_back(
            scene.emitters.empty()                ? "connect, occlude: no emitters"
            : !samples_emitters(scene)            ? "connect, occlude: next event estimation finds none of the emitters"
            : r.mis.estimator == Estimator::naive ? "connect, occlude: estimator naive samples no emitters"
                                                  : "connect, occlude: max_depth leaves no segment for them");
    if (!r.count_hits)
        parts.emplace_back(scene.emitters.empty()
                               ? "mis_weight and accumulate of hits: no emitters"
                               : "mis_weight and accumulate of hits: no ray can meet these emitters");
    if (r.mis.estimator == Estimator::naive &&
        std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return is_delta(e.type); }))
        parts.emplace_back("light of point, spot and directional emitters: estimator naive cannot find it");
    return parts;
}

}  // namespace ambilux
