// Time of stages that a backend runs inside of others (backends/fusion.h) and that have no clock there: estimated from
// a render of the same with fuse=none.
#pragma once

#include <string>
#include <vector>

#include "render/renderer.h"

namespace ambilux {

struct FusedShare {
    std::string stage, inside;  ///< the same where it is what the stage itself does
    double seconds = 0;         ///< of the fused render
    double share = 0;           ///< of the time of `inside`
};

/// Of each stage that runs others inside of it: its own time and theirs, in proportion to their times in the unfused
/// render. They add up to its time. A stage that runs inside of several is split among them as their own times are.
std::vector<FusedShare> fused_shares(const std::vector<StageStats>& fused, const std::vector<StageStats>& unfused);

}  // namespace ambilux
