// What happens when queues that are kept over a wave could not hold what they were given.
#pragma once

#include "queues/wave.h"

namespace ambilux {

/// If a queue has overflowed, the wave fails: it has no samples any more. The peaks tell the capacity that is needed.
AMBILUX_HD void fail_wave_on_overflow(WaveState& state, QueueCounter& a, QueueCounter& b) {
    if (a.count <= a.capacity && b.count <= b.capacity) return;
    for (QueueCounter* q : {&a, &b}) {
        if (q->count > q->peak) q->peak = q->count;
        q->count = q->holes = 0;
    }
    state.failed = 1;
    state.samples = 0;
}

}  // namespace ambilux
