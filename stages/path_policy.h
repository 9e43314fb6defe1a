// What a path tracer does where, decided once by the host.
#pragma once

#include "queues/order.h"
#include "transport/mis.h"

namespace ambilux {

enum class Estimator : uint32_t { naive, nee, mis };

struct PathPolicy {
    Estimator estimator;
    MisHeuristic heuristic;
    uint32_t max_depth;     ///< segments; WalkBits::kMaxDepth stands for no limit
    uint32_t rr_depth;      ///< Russian roulette at vertices with at least this many segments
    bool count_hits;        ///< some emitter can be met by a ray
    bool connect;           ///< emitters are sampled
    bool hide_emitters;     ///< the camera does not see emitters
    bool fuse;              ///< light is weighted and added up by the stages that find it, not by stages of their own
    bool connect_in_shade;  ///< shade samples emitters too: the surface and its BSDF are looked up once
    uint32_t tail_below;    ///< on a device: fewer walks than this go on for several depths in one launch
                            ///< (stages/tail.h); 0: never
    float cull;  ///< share of a path's light below which what it finds faces Russian roulette before the shadow ray; 0:
                 ///< never
    QueuePolicy queues;
};

}  // namespace ambilux
