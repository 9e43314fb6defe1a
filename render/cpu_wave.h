// The shape of a wave on the CPU.
#pragma once

#include <algorithm>

#include "integrators/integrator.h"

namespace ambilux {

/// Paths of one wave: with the surfaces and texels that they meet, about 1 KiB each, they stay in a core's second-level
/// cache from stage to stage.
constexpr uint32_t kCpuWaveSize = 512;

/// Enough waves that `threads` end together.
inline Wave cpu_wave(const Scene& scene, const RenderSettings& settings, int threads) {
    const uint32_t tiles = tile_count(shape_wave(scene, settings.seed, kTilePixels, 1));
    const uint32_t max_tiles = std::max(1u, tiles / uint32_t(8 * threads));
    return shape_wave(scene, settings.seed, settings.wave_size ? settings.wave_size : kCpuWaveSize, max_tiles);
}

}  // namespace ambilux
