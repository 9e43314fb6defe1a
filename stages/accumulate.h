// accumulate: light is added to the sample of its path.
#pragma once

#include "film/strategy_film.h"
#include "stages/stage.h"

namespace ambilux {

/// As a rule one launch holds at most one contribution per path, so that no two threads meet and the sum does not
/// depend on the order of the queue; launches with several say so by `needs_atomic_add`.
struct Accumulate {
    static constexpr const char* kName = "accumulate";

    Queue<Contribution> contributions;
    Lane* samples;
    StageRecord* record;
    Wave wave;
    StrategyFilm strategies;
    bool needs_atomic_add = false;

    const Queue<Contribution>& items() const { return contributions; }
    AMBILUX_HD void operator()(uint32_t i) const { push(contributions.load(i)); }

    AMBILUX_HD uint32_t push(const Contribution& c) const {
        if (!is_valid_radiance(c.value, record)) return 0;
        if (needs_atomic_add)
            add_rgb(reinterpret_cast<float*>(samples + c.path), c.value);
        else
            set_start(samples[c.path], start_of<Rgb>(samples[c.path]) + c.value);
        if (strategies.sums) strategies.arrive(c.path, wave.width * wave.height, wave.locate(c.path).pixel, c.value);
        return 0;
    }
};

}  // namespace ambilux
