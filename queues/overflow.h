// What happens when what waves keep does not fit.
#pragma once

#include "core/atomic.h"
#include "queues/wave.h"

namespace ambilux {

/// The wave has no samples any more, so that the stages that follow find nothing to do.
AMBILUX_HD void fail_wave(WaveState& state, WaveFailure why) {
    state.failed = why;
    state.samples = 0;
}

/// If a queue has overflowed, the wave fails. The peaks tell the capacity that is needed.
AMBILUX_HD void fail_wave_on_overflow(WaveState& state, QueueCounter& a, QueueCounter& b) {
    if (a.count <= a.capacity && b.count <= b.capacity) return;
    for (QueueCounter* q : {&a, &b}) {
        if (q->count > q->peak) q->peak = q->count;
        q->count = q->holes = 0;
    }
    fail_wave(state, kQueuesFull);
}

/// Reserves room in what all waves append to (`all`) for what is in `mine`, or fails the wave and empties `mine`: what
/// has been appended stays whole, and a wave that failed, here or before, has left nothing there.
AMBILUX_HD void reserve_appended(WaveState& state, QueueCounter& mine, QueueCounter& all) {
    const uint32_t items = mine.size();
    if (!state.failed) {
        if (add_up_to(&all.count, items, all.capacity, state.appended)) return;
        raise_shared(&all.peak, uint64_t(all.capacity) + items);
        fail_wave(state, kAppendedFull);
    }
    mine.finish();
}

}  // namespace ambilux
