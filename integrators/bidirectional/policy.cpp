#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "integrators/bidirectional/wave.h"
#include "integrators/path/path_wave.h"

namespace ambilux {

BidirectionalPolicy make_bidirectional_policy(const Scene& scene, const RenderSettings& settings) {
    if (settings.max_depth < 0 && settings.rr_depth < 0)
        throw Error(ExitCode::usage,
                    "max_depth=-1 with rr_depth=-1: without Russian roulette and without a limit walks may never end; "
                    "set one of them");
    BidirectionalPolicy p{};
    p.mis.heuristic = settings.heuristic;
    p.mis.strategies = settings.integrator == "light" ? uint32_t(kLightStrategies) : settings.strategies;
    p.singles = settings.integrator == "light" ? SingleStrategies{} : settings.singles;
    p.light_walks_per_tile = settings.light_walks_per_tile;
    const Wave film = shape_wave(scene, settings, kTilePixels, 1);
    p.mis.light_walks = float(light_walks_in(film, 0, tile_count(film), p.light_walks_per_tile));
    p.max_depth = settings.max_depth < 0 ? WalkBits::kMaxDepth : uint32_t(settings.max_depth);
    p.rr_depth = settings.rr_depth < 0 ? ~0u : uint32_t(settings.rr_depth);
    if (p.singles.on) {
        uint32_t longest = SingleStrategies::kMaxSegments;
        while (longest > 0 && p.singles.s[longest] == SingleStrategies::kNone) --longest;
        p.max_depth = std::min(p.max_depth, longest);
    }
    p.technique_depth = std::min(settings.technique_depth, p.max_depth);
    const bool emitters = !scene.emitters.empty();
    const bool area = std::any_of(scene.emitters.begin(), scene.emitters.end(),
                                  [](const Emitter& e) { return e.type == EmitterType::area; });
    p.splat = emitters && p.mis.has(kLightStrategies);
    p.connect_vertices = emitters && p.mis.has(kConnectionStrategies) && p.max_depth >= 3;
    p.light_walks = p.splat || p.connect_vertices;
    p.next_event = emitters && p.mis.has(kNextEventStrategies) && p.max_depth >= 2;
    p.count_hits = area && p.mis.has(kHitStrategies);
    // No light walk finds the environment that the camera sees: eye walks of one segment count it for the light tracer.
    p.count_environment = scene.environment != kNone && p.mis.has(kHitStrategies | kLightStrategies);
    p.mis.connections = 1.0f;
    p.megakernel = settings.variant == "megakernel";
    p.cache_draws = settings.variant == "lvc" && p.connect_vertices ? settings.connections : 0;
    if (p.light_walks_per_tile != kTilePixels) {
        const double light_paths = double(p.light_walks_per_tile) / kTilePixels;
        if (p.megakernel || settings.variant == "streaming")
            throw Error(
                ExitCode::usage,
                fmt::format(
                    "light_paths={}: variant {} has one light walk per eye walk, or eye vertex; use variant lvc",
                    light_paths, settings.variant));
        if (p.connect_vertices && p.cache_draws == 0)
            throw Error(ExitCode::usage,
                        fmt::format("light_paths={}: variant wavefront connects every eye walk with a light walk of "
                                    "its own; use variant lvc, or strategies without connections",
                                    light_paths));
        if (uint64_t(film.width) * film.height * p.light_rounds() > 0xffffffffull)
            throw Error(
                ExitCode::usage,
                fmt::format("light_paths={}: a film of {}x{} has more light walks than can be numbered (4294967295)",
                            light_paths, film.width, film.height));
    }
    // A launch with several pairs of one vertex adds to sums in the order in which threads come, images of single
    // strategies tell contributions of one path apart by launches, and a place of a path holds one item. Of one draw
    // there is no second.
    p.one_pair =
        settings.deterministic || p.technique_depth > 0 || p.cache_draws == 1 || settings.queues.fixed_places();
    p.vertex_lanes = Queue<VertexItem>::kLanes;
    p.connection_lanes = Queue<ConnectionVertex>::kLanes;
    p.background_only = p.mis.strategies == kLightStrategies;
    p.hide_emitters = scene.integrator.hide_emitters;
    p.fuse = settings.fuse != Fuse::none;
    p.connect_in_shade = settings.fuse == Fuse::all && settings.variant != "streaming";
    p.cull = settings.cull;
    p.queues = settings.queues;
    return p;
}

std::vector<TechniqueImage> technique_images(uint32_t max_depth, uint64_t samples, const std::vector<int64_t>& sums,
                                             const std::vector<uint64_t>& dropped) {
    std::vector<TechniqueImage> images;
    if (max_depth == 0) return images;
    const size_t values = sums.size() / 2 / technique_count(max_depth);
    const double scale = samples ? kLightUnit / double(samples) : 0.0;
    for (uint32_t k = 1; k <= max_depth; ++k) {
        for (uint32_t s = 0; s <= k; ++s) {
            const uint32_t technique = technique_index(Strategy::make(s, k + 1 - s));
            TechniqueImage image = {s, k + 1 - s, std::vector<float>(values), std::vector<float>(values),
                                    dropped[technique]};
            const int64_t* raw = sums.data() + 2 * technique * values;
            for (size_t i = 0; i < values; ++i) {
                image.raw[i] = float(double(raw[i]) * scale);
                image.weighted[i] = float(double(raw[values + i]) * scale);
            }
            images.push_back(std::move(image));
        }
    }
    return images;
}

std::vector<std::string> skipped_strategies(const Scene& scene, const BidirectionalPolicy& policy,
                                            const Features& kernels) {
    std::vector<std::string> parts;
    if (scene.emitters.empty()) parts.emplace_back("all strategies: no emitters");
    if (!policy.light_walks) parts.emplace_back("light walks: no strategy needs them");
    if (!policy.splat) parts.emplace_back("light tracing (t = 1)");
    if (!policy.connect_vertices) parts.emplace_back("connections (s, t >= 2)");
    if (!policy.next_event) parts.emplace_back("next event estimation (s = 1)");
    if (!policy.count_hits) parts.emplace_back("hits of area emitters (s = 0)");
    if (policy.background_only) parts.emplace_back("eye walks beyond their first segment");
    if (!kernels.textures) parts.emplace_back("texture lookup");
    if (!kernels.bumps) parts.emplace_back("bump and normal maps");
    if (!kernels.opacity) parts.emplace_back("opacity tests in traversal");
    if (!kernels.has_quadrics()) parts.emplace_back("spheres, disks and cylinders");
    if (!kernels.has_environment()) parts.emplace_back("environment: rays that leave the scene end in extend");
    return parts;
}

}  // namespace ambilux
