// Light subpaths of an iteration by number: an order that knows nothing of waves and threads.
#pragma once

#include "queues/wave.h"

namespace ambilux {

/// Of the light subpath that begins in `slot`. The iteration has `samples` samples, a slot up to `rounds` light
/// subpaths (Wave::first_key).
AMBILUX_HD uint32_t light_subpath_number(const Wave& wave, uint32_t slot, uint32_t samples, uint32_t rounds) {
    const RngKey key = wave.key(slot, Stream::light);
    return (key.sample - wave.state->iteration * samples) * (wave.width * wave.height * rounds) + key.index;
}

}  // namespace ambilux
