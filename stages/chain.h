// Stages whose items are chains of steps, of different length.
#pragma once

#include "core/math.h"

namespace ambilux {

/// What a launch over chains has seen: steps beyond one per item, and rays that there was no launch for.
struct ChainCount {
    int32_t steps, rays;
};

/// `stage` has begin(i), the chain of an item; step(chain, count), false after its last step; place(chain), where its
/// last step pushed to; room(), how many such places there are, of which one step takes one at most; one_step(),
/// whether a launch is to take only one of each chain; put_back(chain, count), for what is left to another launch; and
/// add(count), which keeps the records.
template <class Stage>
concept Chained = requires(const Stage& stage, typename Stage::Chain& chain, ChainCount& count) {
    chain = stage.begin(0);
    static_cast<bool>(stage.step(chain, count));
    static_cast<uint32_t>(stage.place(chain));
    static_cast<uint32_t>(stage.room());
    static_cast<bool>(stage.one_step());
    stage.put_back(chain, count);
    stage.add(count);
    Stage::kBlocksPerSm;
};

}  // namespace ambilux
