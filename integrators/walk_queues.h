// Rays and hits of walks: hits are completed where their rays lie, and a stage that reads the hits of one depth pushes the rays of the next. So there are two places for them, which take
// turns from depth to depth.
#pragma once

#include <type_traits>

#include "queues/layout.h"
#include "stages/stage.h"

namespace ambilux {

/// Members of a wave's memory. One place is empty while the other holds items, so both have the same counters.
template <class RayItem, class HitItem>
struct WalkQueues {
    Queue<RayItem> rays[2];
    Queue<HitItem> hits[2];
};

template <class RayItem, class HitItem>
void lay_out_walks(Layout& layout, WalkQueues<RayItem, HitItem>& m, QueueCounter* counters, uint32_t slots, bool fixed) {
    m.hits[0] = layout.queue<HitItem>("hits", counters, slots, fixed);
    m.rays[0] = layout.front<RayItem>("rays", counters, m.hits[0], fixed);
    m.hits[1] = layout.alternate(m.hits[0]);
    m.rays[1] = m.rays[0];
    m.rays[1].base = m.hits[1].base;
}

/// From the hits of depth 1 in place 0 on: body(k) goes through the hits of a depth in place k and pushes rays to place 1 - k, which then become the next hits.
template <class Executor, class RayItem, class HitItem, class Extend, class Body>
void repeat_depths(Executor& exec, StageId id, const Extend (&extend)[2], const WalkQueues<RayItem, HitItem>& m, Body body) {
    exec.repeat_while(m.hits[0], [&] {
        for (const int k : {0, 1}) {
            body(k);
            exec.next_depth();
            exec.extend(id, extend[1 - k], m.rays[1 - k], m.hits[1 - k]);
        }
    });
}

}  // namespace ambilux
