#include "integrators/integrator.h"

#include <fmt/format.h>

#include "core/error.h"

namespace ambilux {

void check_depths(const RenderSettings& settings) {
    if (settings.max_depth < 0 && settings.rr_depth < 0)
        throw Error(ExitCode::usage,
                    "max_depth=-1 with rr_depth=-1: without Russian roulette and without a limit paths may never end; "
                    "set one of them");
    constexpr float kEndingCap = 0.999f;  // 0.999^kMaxDepth = 8e-8
    if (settings.max_depth < 0 && settings.rr_cap > kEndingCap)
        throw Error(
            ExitCode::usage,
            fmt::format("rr_cap={} with max_depth=-1: subpaths between surfaces that reflect all would not end; "
                        "rr_cap may be {} at most, or set max_depth",
                        settings.rr_cap, kEndingCap));
    if (settings.max_depth >= int(kMaxDepth))
        throw Error(ExitCode::usage, fmt::format("max_depth={}: at most {} segments, or -1 for no limit",
                                                 settings.max_depth, kMaxDepth - 1));
}

uint32_t segment_limit(const RenderSettings& settings) {
    return settings.max_depth < 0 ? kMaxDepth : uint32_t(settings.max_depth);
}

uint32_t roulette_depth(const RenderSettings& settings) {
    return settings.rr_depth < 0 ? ~0u : uint32_t(settings.rr_depth);
}

void skipped_features(const Features& kernels, std::vector<std::string>& parts) {
    if (!kernels.textures) parts.emplace_back("texture lookup");
    if (!kernels.bumps) parts.emplace_back("bump and normal maps");
    if (!kernels.opacity) parts.emplace_back("opacity tests in traversal");
    if (!kernels.has_quadrics()) parts.emplace_back("spheres, disks and cylinders");
    if (!kernels.has_environment()) parts.emplace_back("environment: rays that leave the scene end in extend");
}

Wave shape_wave(const Scene& scene, uint64_t seed, uint32_t wave_size, uint32_t max_tiles) {
    Wave w{};
    w.seed = seed;
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

}  // namespace ambilux
