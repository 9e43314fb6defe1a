// Rays and hits of subpaths: hits are completed where their rays lie, and a stage that reads the hits of one depth
// pushes the rays of the next. So there are two places for them, which take turns from depth to depth.
#pragma once

#include <type_traits>

#include "items/subpath_items.h"
#include "queues/layout.h"
#include "queues/order.h"
#include "stages/multi_bounce.h"

namespace ambilux {

/// One place is empty while the other holds items, so both have the same counters.
template <class Ray>
struct SubpathQueues {
    Queue<Ray> rays[2];
    Queue<HitItem<Ray>> hits[2];

    SubpathQueues() = default;
    [[gnu::cold]] SubpathQueues(Layout& layout, uint32_t slots, const QueuePolicy& policy) {
        hits[0] = layout.queue<HitItem<Ray>>("hits", slots, policy.fixed_places());
        rays[0] = layout.front<Ray>("rays", hits[0]);
        if (policy.keyed_hits) hits[0].keys = layout.allocate<uint16_t>(slots);
        hits[1] = layout.alternate(hits[0]);
        rays[1] = rays[0];
        rays[1].items = {hits[1].items.base, slots};
    }
};

/// Hits of camera rays, in place 0. `kFused`: an executor that can do so makes and traces the rays in one launch, for
/// which `generate` has to make one in every active slot.
template <bool kFused, class Executor, class Generate, class Extend>
void start_eye_subpaths(Executor& exec, const Generate& generate, const Extend& extend, uint32_t slots) {
    if constexpr (kFused)
        if (!extend.hits.flags) return exec.generate_and_extend(generate, extend, slots);
    exec.run_slots(generate, slots);
    exec.set_depth(1);
    exec.extend_coherent(extend);
}

/// Nothing is done before the vertices of a depth.
struct NothingBefore {
    template <class... A>
    void operator()(A...) const {}
};

/// From the hits of depth 1 in place 0 on: after before(k, vertex[k]) vertex[k] goes through the hits of a depth in
/// place k and pushes rays to place 1 - k, which after rest(several_bounces) become the next hits. `several_bounces` is
/// true where a device takes fewer than `multi_bounce_below` subpaths through several at once: what is pushed may
/// belong to one path more than once. With something to be done before the vertices of every depth it takes one at a
/// time.
template <class Executor, class VertexStage, class Extend, class Rest, class Before = NothingBefore>
void repeat_depths(Executor& exec, const VertexStage (&vertex)[2], const Extend (&extend)[2],
                   uint32_t multi_bounce_below, Rest rest, Before before = {}) {
    const auto two_rounds = [&](auto several_bounces) {
        for (const int k : {0, 1}) {
            before(k, vertex[k]);
            if constexpr (several_bounces)
                exec.run(MultiBounce<VertexStage, Extend>{vertex[k], extend[1 - k], vertex[k].record});
            else
                exec.run(vertex[k]);
            rest(several_bounces.value);
            exec.next_depth(several_bounces ? kBouncesPerLaunch : 1);
            exec.extend(extend[1 - k]);
        }
    };
    if constexpr (!Executor::kHost && std::is_same_v<Before, NothingBefore>) {
        if (multi_bounce_below > 0) {
            exec.repeat_while(extend[0].hits, [&] { two_rounds(std::false_type()); }, multi_bounce_below);
            exec.repeat_while(extend[0].hits, [&] { two_rounds(std::true_type()); });
            return;
        }
    }
    exec.repeat_while(extend[0].hits, [&] { two_rounds(std::false_type()); });
}

}  // namespace ambilux
