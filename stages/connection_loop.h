// Stages whose items are loops of steps, of different length. Lanes of a warp that have ended theirs begin another
// item, and none waits for the longest.
#pragma once

#include "core/math.h"

namespace ambilux {

/// What a launch has seen: steps beyond one per item, and rays that there was no launch for.
struct LoopCount {
    int32_t steps, rays;
};

/// `stage` has begin(i), the loop of an item; step(loop, count), false after its last step; slot(loop), where its last
/// step pushed to; capacity(), how many such slots there are, of which one step takes one at most; one_step(), whether
/// a launch is to take only one step of each loop; defer(loop, count), for what is left to another launch; and
/// add(count), which keeps the records.
template <class Stage>
concept ConnectionLoop = requires(const Stage& stage, typename Stage::Loop& loop, LoopCount& count) {
    loop = stage.begin(0);
    static_cast<bool>(stage.step(loop, count));
    static_cast<uint32_t>(stage.slot(loop));
    static_cast<uint32_t>(stage.capacity());
    static_cast<bool>(stage.one_step());
    stage.defer(loop, count);
    stage.add(count);
};

}  // namespace ambilux
