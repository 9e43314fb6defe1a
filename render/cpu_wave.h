// The shape of a wave on the CPU.
#pragma once

#include <algorithm>

#include "integrators/integrator.h"

namespace ambilux {

/// Paths of one wave: with the surfaces and texels that they meet, about 1 KiB each, they stay in a core's second-level
/// cache from stage to stage.
constexpr uint32_t kCpuWaveSize = 512;

/// Paths of a wave where there is memory for it.
inline uint32_t cpu_wave_size(const RenderSettings& settings) {
    return settings.wave_size ? settings.wave_size : kCpuWaveSize;
}

/// A wave of about `size` paths. Enough waves that `threads` end together.
inline Wave cpu_wave(const Scene& scene, const RenderSettings& settings, int threads, uint32_t size) {
    const uint32_t tiles = tile_count(shape_wave(scene, settings.seed, kTilePixels, 1));
    const uint32_t max_tiles = std::max(1u, tiles / uint32_t(8 * threads));
    return shape_wave(scene, settings.seed, size, max_tiles);
}

}  // namespace ambilux
