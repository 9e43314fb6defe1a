// The film on a device: sums of samples, splats, and images of single strategies, in one allocation.
#pragma once

#include "integrators/integrator.h"
#include "render/statistics.h"

namespace ambilux {

/// Places for the film of `wave`, which is added to it at once; its memory must be zero at first. `splats`: a sample of
/// any pixel may add to any other one, so that each pixel has a sum for every sample of a wave.
inline FilmBuffers lay_out_film(Layout& layout, const Wave& wave, const WavePolicy& policy, bool splats) {
    const uint64_t pixels = uint64_t(wave.width) * wave.height, cells = splats ? pixels * wave.samples : 0;
    FilmBuffers film{};
    film.sums = {layout.allocate<double>(pixels * 3), layout.allocate<double>(pixels * 3)};
    film.samples = layout.allocate<Lane>(wave.slot_count());
    if (cells && policy.deterministic) film.splats.doubles = layout.allocate<double>(cells * 3);
    if (cells && !policy.deterministic) film.splats.floats = layout.allocate<Lane>(cells);
    if (policy.strategy_depth > 0) {
        film.strategies = layout.allocate<double>(strategy_values(policy.strategy_depth, pixels));
        film.strategies_dropped = layout.allocate<uint64_t>(strategy_count(policy.strategy_depth));
    }
    return film;
}

}  // namespace ambilux
