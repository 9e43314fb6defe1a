#include "integrators/bdpt/shared/policy.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "integrators/registry.h"

namespace ambilux {
namespace {

/// Groups and single strategies that are on, and the longest path that one of these finds.
void set_strategies(Rules<BidirectionalMis>& r, const RenderSettings& settings) {
    const Variant& variant = variant_of(settings);
    r.mis.strategies = variant.strategies ? variant.strategies(settings) & kAllStrategies : kLightStrategies;
    r.singles = variant.traits.strategies ? settings.singles : SingleStrategies{};
    if (!r.singles.on) return;
    uint32_t longest = SingleStrategies::kMaxSegments;
    while (longest > 0 && r.singles.s[longest] == SingleStrategies::kNone) --longest;
    r.max_depth = std::min(r.max_depth, longest);
}

/// What the strategies that are on ask of the subpaths.
void set_rules(Rules<BidirectionalMis>& r, const Scene& scene) {
    const bool emitters = !scene.emitters.empty();
    const bool area = std::any_of(scene.emitters.begin(), scene.emitters.end(),
                                  [](const Emitter& e) { return e.type == EmitterType::area; });
    const bool sampled =
        std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return !is_beam(e.type); });
    r.splat = emitters && r.mis.has(kLightStrategies) && r.max_depth > 0;
    r.connect = emitters && r.mis.has(kConnectionStrategies) && r.max_depth >= 3;
    r.next_event = sampled && r.mis.has(kNextEventStrategies) && r.max_depth >= 2;
    r.count_hits = area && r.mis.has(kHitStrategies);
    // No light subpath finds the environment that the camera sees: eye subpaths of one segment count it for the light
    // tracer.
    r.count_environment = scene.environment != kNone && r.mis.has(kHitStrategies | kLightStrategies);
    r.background_only = r.mis.strategies == kLightStrategies;
    r.hide_emitters = scene.integrator.hide_emitters;
}

}  // namespace

BdptPolicy plan_bdpt(const Scene& scene, const RenderSettings& settings) {
    check_depths(settings);
    BdptPolicy p{};
    p.rules.max_depth = segment_limit(settings);
    p.rules.rr_depth = roulette_depth(settings);
    p.rules.rr_cap = settings.rr_cap;
    set_strategies(p.rules, settings);
    set_rules(p.rules, scene);
    const Wave film = shape_wave(scene, settings.seed, kTilePixels, 1);
    p.waves.light_subpaths_per_tile = settings.light_subpaths_per_tile;
    p.waves.keeps_light_vertices = true;
    p.rules.mis.heuristic = settings.heuristic;
    p.rules.mis.connections = 1.0f;
    p.rules.mis.light_subpaths = float(light_subpaths_in(film, 0, tile_count(film), p.waves.light_subpaths_per_tile));
    if (uint64_t(film.width) * film.height * p.waves.light_rounds() > 0xffffffffull)
        throw Error(ExitCode::usage,
                    fmt::format("light_paths={}: a film of {}x{} has more light subpaths than can be numbered "
                                "(4294967295)",
                                double(settings.light_subpaths_per_tile) / kTilePixels, film.width, film.height));
    p.waves.strategy_depth = std::min(settings.technique_depth, p.rules.max_depth);
    p.waves.queues = settings.queues;
    p.waves.cull = settings.cull;
    p.waves.deterministic = settings.deterministic;
    // A launch with several connections of one vertex adds to sums in the order in which threads come, images of single
    // strategies tell contributions of one path apart by launches, and the slot of a path holds one item.
    p.one_connection_per_launch =
        settings.deterministic || p.waves.strategy_depth > 0 || settings.queues.fixed_places();
    return p;
}

void need_one_light_subpath(const RenderSettings& settings, const char* why) {
    if (settings.light_subpaths_per_tile != kTilePixels)
        throw Error(ExitCode::usage,
                    fmt::format("light_paths={}: {}", double(settings.light_subpaths_per_tile) / kTilePixels, why));
}

std::vector<std::string> skipped_strategies(const Scene& scene, const BdptPolicy& policy) {
    const Rules<BidirectionalMis>& r = policy.rules;
    std::vector<std::string> parts;
    if (scene.emitters.empty()) parts.emplace_back("all strategies: no emitters");
    if (!policy.light_subpaths()) parts.emplace_back("light subpaths: no strategy needs them");
    if (!r.splat) parts.emplace_back("light tracing (t = 1)");
    if (!r.connect) parts.emplace_back("connections (s, t >= 2)");
    if (!r.next_event) parts.emplace_back("next event estimation (s = 1)");
    if (!r.count_hits) parts.emplace_back("hits of area emitters (s = 0)");
    if (r.background_only) parts.emplace_back("eye subpaths beyond their first segment");
    return parts;
}

}  // namespace ambilux
