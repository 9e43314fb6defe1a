#include <fmt/format.h>
#include <algorithm>

#include "core/error.h"
#include "integrators/path/path_wave.h"

namespace ambilux {

PathPolicy make_path_policy(const Scene& scene, const RenderSettings& settings) {
    PathPolicy p{};
    p.estimator = settings.estimator;
    p.heuristic = settings.heuristic;
    if (settings.max_depth < 0 && settings.rr_depth < 0)
        throw Error(ExitCode::usage,
                    "max_depth=-1 with rr_depth=-1: without Russian roulette and without a limit paths may never end; "
                    "set one of them");
    constexpr uint32_t kUnbounded = WalkBits::kMaxDepth;
    if (settings.max_depth >= int(kUnbounded))
        throw Error(ExitCode::usage, fmt::format("max_depth={}: at most {} segments, or -1 for no limit",
                                                 settings.max_depth, kUnbounded - 1));
    p.max_depth = settings.max_depth < 0 ? kUnbounded : uint32_t(settings.max_depth);
    p.rr_depth = settings.rr_depth < 0 ? ~0u : uint32_t(settings.rr_depth);
    const bool emitters = !scene.emitters.empty();
    p.count_hits =
        std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return !is_delta(e.type); });
    p.connect = emitters && p.estimator != Estimator::naive && p.max_depth >= 2;
    p.hide_emitters = scene.integrator.hide_emitters;
    p.fuse = settings.fuse != Fuse::none;
    p.connect_in_shade = settings.fuse == Fuse::all;
    p.cull = settings.cull;
    p.queues = settings.queues;
    return p;
}

Wave shape_wave(const Scene& scene, const RenderSettings& settings, uint32_t wave_size, uint32_t max_tiles) {
    Wave w{};
    w.seed = settings.seed;
    w.width = scene.sensor.crop_width;
    w.height = scene.sensor.crop_height;
    if (uint64_t(w.width) * w.height > 0xffffffffull)
        throw Error(ExitCode::usage, fmt::format("a film of {}x{} has more pixels than can be numbered (4294967295)",
                                                 w.width, w.height));
    w.tiles_x = (w.width + kTileSide - 1) / kTileSide;
    const uint64_t tiles = tile_count(w);
    w.tiles = uint32_t(std::clamp<uint64_t>(wave_size / kTilePixels, 1, std::min<uint64_t>(tiles, max_tiles)));
    w.samples = std::max(1u, wave_size / (w.tiles * kTilePixels));
    return w;
}

uint32_t tile_count(const Wave& wave) { return wave.tiles_x * ((wave.height + kTileSide - 1) / kTileSide); }

std::vector<std::string> skipped_parts(const Scene& scene, const PathPolicy& policy, const Features& kernels) {
    std::vector<std::string> parts;
    if (!policy.connect) {
        parts.emplace_back(scene.emitters.empty() ? "connect, occlude: no emitters"
                           : policy.estimator == Estimator::naive
                               ? "connect, occlude: estimator naive samples no emitters"
                               : "connect, occlude: max_depth leaves no segment for them");
    }
    if (!policy.count_hits)
        parts.emplace_back(scene.emitters.empty()
                               ? "mis_weight and accumulate of hits: no emitters"
                               : "mis_weight and accumulate of hits: no ray can meet these emitters");
    if (policy.estimator == Estimator::naive &&
        std::any_of(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) { return is_delta(e.type); }))
        parts.emplace_back("light of point, spot and directional emitters: estimator naive cannot find it");
    if (!kernels.textures) parts.emplace_back("texture lookup");
    if (!kernels.bumps) parts.emplace_back("bump and normal maps");
    if (!kernels.opacity) parts.emplace_back("opacity tests in traversal");
    if (!kernels.has_quadrics()) parts.emplace_back("spheres, disks and cylinders");
    if (!kernels.has_environment()) parts.emplace_back("environment: rays that leave the scene end in extend");
    return parts;
}

}  // namespace ambilux
