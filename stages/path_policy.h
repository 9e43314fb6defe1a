// What a path tracer does where, decided once by the host.
#pragma once

#include "transport/mis.h"

namespace ambilux {

enum class Estimator : uint32_t { naive, nee, mis };

struct PathPolicy {
    Estimator estimator;
    MisHeuristic heuristic;
    uint32_t max_depth;   ///< segments; WalkBits::kMaxDepth stands for no limit
    uint32_t rr_depth;    ///< Russian roulette at vertices with at least this many segments
    bool count_hits;      ///< some emitter can be met by a ray
    bool connect;         ///< emitters are sampled
    bool hide_emitters;   ///< the camera does not see emitters
};

}  // namespace ambilux
