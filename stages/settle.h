// What happens when queues that are kept over a wave could not hold what they were given.
#pragma once

#include "queues/queue.h"
#include "queues/wave.h"

namespace ambilux {

/// Called between the part of a wave that fills the queues and the part that uses them. If one of them has overflowed,
/// the wave fails: it has no samples any more, so that the stages that follow find nothing to do, and the film stays as
/// it was. The peaks tell how much room is needed.
AMBILUX_HD void settle(WaveState& state, QueueCounter& a, QueueCounter& b) {
    if (a.count <= a.capacity && b.count <= b.capacity) return;
    QueueCounter* queues[2] = {&a, &b};
    for (QueueCounter* q : queues) {
        if (q->count > q->peak) q->peak = q->count;
        q->count = q->holes = 0;
    }
    state.failed = 1;
    state.samples = 0;
}

}  // namespace ambilux
