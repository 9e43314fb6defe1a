// What a light tracer or bidirectional path tracer does where, decided once by the host.
#pragma once

#include "queues/order.h"
#include "queues/wave.h"
#include "stages/techniques.h"
#include "transport/bidirectional.h"

namespace ambilux {

/// Bytes of a structure up to which connect_vertices traces its shadow rays itself, in kernels for diffuse surfaces
/// (docs/performance.md).
constexpr uint64_t kTracedInPlace = 4096;

struct BidirectionalPolicy {
    BidirectionalMis mis;
    uint32_t max_depth;  ///< segments; WalkBits::kMaxDepth stands for no limit
    uint32_t rr_depth;
    bool light_walks;               ///< some strategy needs them
    uint32_t light_walks_per_tile;  ///< of kTilePixels pixels, in one sample
    bool splat;                     ///< light vertices are connected with the camera
    bool connect_vertices;
    uint32_t cache_draws;  ///< light vertices that an eye vertex draws from a cache of all; 0: those of the light walk
                           ///< of its slot
    bool one_pair;  ///< launches of connect_vertices have one pair of an eye vertex; else sums of a path depend on the
                    ///< order of threads
    bool trace_pairs;                         ///< on a device: connect_vertices traces its shadow rays itself
    uint32_t vertex_lanes, connection_lanes;  ///< of a VertexItem and a ConnectionVertex that kernels use
    bool next_event;
    bool count_hits;         ///< eye walks count the area emitters that they meet
    bool count_environment;  ///< eye walks count the environment
    bool background_only;   ///< eye walks end at their first vertex: they serve the directly seen environment, which no
                            ///< light walk finds
    bool megakernel;        ///< variant: one thread per slot instead of stages
    uint32_t stream_slots;  ///< variant streaming: slots in flight; 0: another variant
    bool hide_emitters;     ///< the camera does not see emitters
    bool fuse;              ///< light is weighted and added up by the stages that find it, not by stages of their own
    bool connect_in_shade;  ///< vertices are connected with camera and emitters by the stages that make them
    bool at_once;  ///< on a host: shade also connects with the vertices of light walks, and rays that test connections
                   ///< are traced by the stages that make them
    uint32_t tail_below;  ///< on a device: fewer walks than this go on for several depths in one launch
                          ///< (stages/tail.h); 0: never
    float cull;  ///< share of a path's light below which what it finds faces Russian roulette before the shadow ray; 0:
                 ///< never
    SingleStrategies singles;
    uint32_t technique_depth;  ///< segments up to which images of single strategies are gathered; 0: none
    QueuePolicy queues;

    /// Most light walks of a slot.
    AMBILUX_HD uint32_t light_rounds() const { return (light_walks_per_tile + kTilePixels - 1) / kTilePixels; }
    /// Light walks of `slots`, a multiple of kTilePixels, if all of them are active.
    AMBILUX_HD uint64_t most_light_walks(uint32_t slots) const {
        return uint64_t(slots / kTilePixels) * light_walks_per_tile;
    }
    /// Eye walks of `depth` segments count the environment that they reach: beyond the first segment as hits only.
    AMBILUX_HD bool counts_environment(uint32_t depth) const {
        return count_environment && (depth == 1 || mis.has(kHitStrategies));
    }
    /// The last segment of an eye walk can bring nothing but emission; false if that is not wanted.
    AMBILUX_HD bool counts_last_segment() const { return count_hits || (count_environment && mis.has(kHitStrategies)); }
    /// True if what strategy (s,t) finds is to be counted.
    AMBILUX_HD bool wants(uint32_t s, uint32_t t) const { return singles.has(Strategy::make(s, t)); }
    /// The sum of the other strategies for one that is alone.
    AMBILUX_HD float others(float sum) const { return singles.on ? 0.0f : sum; }
};

}  // namespace ambilux
