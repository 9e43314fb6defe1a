// Light subpaths of an iteration by number: an order that knows nothing of waves and threads.
#pragma once

#include "queues/wave.h"

namespace ambilux {

/// How the samples and light subpaths of iterations are numbered.
struct IterationNumbers {
    uint32_t samples;  ///< of an iteration
    uint32_t rounds;   ///< light subpaths of a slot, at most (Wave::first_key)

    /// Which of the iterations that are done at once a sample belongs to.
    AMBILUX_HD uint32_t iteration(const WaveState& state, uint32_t sample) const {
        return sample / samples - state.iteration;
    }
    AMBILUX_HD uint32_t iteration(const Wave& wave, uint32_t slot) const {
        return iteration(*wave.state, wave.state->first_sample + wave.sample_of(slot));
    }
    /// Of the light subpath that begins in `slot`, in its iteration.
    AMBILUX_HD uint32_t light_subpath(const Wave& wave, uint32_t slot) const {
        const RngKey key = wave.key(slot, Stream::light);
        return key.sample % samples * (wave.width * wave.height * rounds) + key.index;
    }
};

}  // namespace ambilux
