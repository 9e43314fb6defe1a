// Rays and hits of walks: hits are completed where their rays lie, and a stage that reads the hits of one depth pushes
// the rays of the next. So there are two places for them, which take turns from depth to depth.
#pragma once

#include <type_traits>

#include "queues/layout.h"
#include "queues/order.h"
#include "stages/stage.h"
#include "stages/tail.h"

namespace ambilux {

/// Members of a wave's memory. One place is empty while the other holds items, so both have the same counters.
template <class RayItem, class HitItem>
struct WalkQueues {
    Queue<RayItem> rays[2];
    Queue<HitItem> hits[2];
};

template <class RayItem, class HitItem>
void lay_out_walks(Layout& layout, WalkQueues<RayItem, HitItem>& m, QueueCounter* counters, uint32_t slots,
                   const QueuePolicy& policy) {
    const bool fixed = policy.fixed_places();
    m.hits[0] = layout.queue<HitItem>("hits", counters, slots, fixed);
    m.rays[0] = layout.front<RayItem>("rays", counters, m.hits[0], fixed);
    if (policy.keyed_hits) m.hits[0].keys = layout.take<uint16_t>(slots);
    m.hits[1] = layout.alternate(m.hits[0]);
    m.rays[1] = m.rays[0];
    m.rays[1].base = m.hits[1].base;
}

/// Hits of camera rays, in place 0. Executors that can do so make and trace the rays in one launch if `fuse` says so.
template <class Executor, class Generate, class Extend, class RayItem, class HitItem>
void start_eye_walks(Executor& exec, const Generate& generate, const Extend& extend,
                     const WalkQueues<RayItem, HitItem>& m, uint32_t slots, [[maybe_unused]] bool fuse) {
    if constexpr (requires { exec.generate_and_extend(generate, extend, slots); }) {
        if (fuse && !m.hits[0].flags) return exec.generate_and_extend(generate, extend, slots);
    }
    exec.run_slots(StageId::generate, generate, slots);
    exec.set_depth(1);
    exec.extend_coherent(StageId::extend, extend, m.rays[0], m.hits[0]);
}

/// From the hits of depth 1 in place 0 on: shade[k] goes through the hits of a depth in place k and pushes rays to
/// place 1 - k, which after rest(tail) become the next hits. Executors that can do so take fewer than `tail_below`
/// walks through several depths at once (stages/tail.h); `tail` is true then, and what is pushed may belong to one path
/// more than once.
template <class Executor, class RayItem, class HitItem, class Shade, class Extend, class Rest>
void repeat_depths(Executor& exec, StageId shade_id, const Shade (&shade)[2], StageId extend_id,
                   const Extend (&extend)[2], const WalkQueues<RayItem, HitItem>& m, uint32_t tail_below, Rest rest) {
    const auto two_rounds = [&](auto tail) {
        for (const int k : {0, 1}) {
            if constexpr (tail)
                exec.run_tail(shade_id, shade[k], extend[1 - k], m.hits[k]);
            else
                exec.run(shade_id, shade[k], m.hits[k]);
            rest(tail.value);
            exec.next_depth(tail ? kTailDepths : 1);
            exec.extend(extend_id, extend[1 - k], m.rays[1 - k], m.hits[1 - k]);
        }
    };
    if constexpr (requires { Executor::kTails; }) {
        if (tail_below > 0) {
            exec.repeat_while(m.hits[0], [&] { two_rounds(std::false_type()); }, tail_below);
            exec.repeat_while(m.hits[0], [&] { two_rounds(std::true_type()); });
            return;
        }
    }
    exec.repeat_while(m.hits[0], [&] { two_rounds(std::false_type()); });
}

}  // namespace ambilux
