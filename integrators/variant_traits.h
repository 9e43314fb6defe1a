// What settings have an effect on: each variant of an integrator states it in its folder (variant.h).
#pragma once

#include <cstdint>

namespace ambilux {

/// How a replay (render/replay) finds the light vertices that an eye vertex is connected with.
enum class ReplayPairing : uint32_t {
    no_replay,    ///< there is no replay
    none,         ///< there are no connections
    own_subpath,  ///< those of the slot's light subpath, from its end
    registers,    ///< the same, with the eye vertex as it is instead of as items keep it
    own_vertex,   ///< those of a light subpath that is made for this eye vertex, from its start
    cache,        ///< drawn from those of a wave
    iteration,    ///< drawn from those of an iteration, and merged with those nearby
};

/// How a variant makes references (experiments/reference.h), for which its default settings must find all light.
enum class References : uint32_t {
    none,
    plain,     ///< by its first variant and estimator mis; but for precision, no setting makes it another reference
    as_it_is,  ///< settings are a part of the identity
};

/// What merges, of an eye subpath's vertex with light vertices nearby, stand beside.
enum class Merges : uint32_t {
    none,    ///< nothing is merged
    beside,  ///< all other strategies, weighted against them
    alone,   ///< merges at the other vertices, weighted; emission counts where it is seen through deltas alone
    first,   ///< nothing: an eye subpath ends where it would scatter after it has merged
};

/// Beside StrategyBits: both subpaths end at one vertex, within a radius.
constexpr uint32_t kMergeStrategies = 16;
/// Beside StrategyBits: eye subpaths go on through deltas alone. They meet emitters so, and are joined with light
/// subpaths where they would first scatter by another lobe.
constexpr uint32_t kJoinedAtFirst = 32;

/// What a variant of an integrator has. Settings that need something else are refused by name (setting.h).
struct VariantTraits {
    bool estimators = false;       ///< hits, next event estimation or both (Estimator)
    bool strategies = false;       ///< strategies (s,t) to choose from
    bool light_subpaths = false;   ///< subpaths that start on emitters
    bool draws = false;            ///< eye vertices draw light vertices from a cache
    bool draws_together = false;   ///< lanes of a warp may draw vertices that lie together
    bool strategy_images = false;  ///< gathers images of single strategies
    bool weights = true;           ///< weighs strategies against each other
    bool culls = true;             ///< has shadow rays that Russian roulette may drop
    bool sorts = true;             ///< has queues that can be sorted
    bool compacts = true;          ///< has queues whose items can lie by path
    bool repeats = true;           ///< on a device too, bits repeat with deterministic=true
    bool binary_bvh = false;       ///< has kernels for accel=bvh2
    bool one_kernel = false;       ///< on a device rays do not pass through queues
    bool streams = false;          ///< a wave holds more paths than it has slots
    bool light_tree = false;       ///< has kernels that pick lights by a tree (level Sampling)
    bool sobol = false;            ///< has kernels whose numbers are Sobol' points (level Sampling)
    bool in_double = false;        ///< has a twin in double precision (render/twin/twin.h)
    bool selects_any = false;      ///< bdpt.auto=true selects any variant; else this one or the path tracer
    Merges merges = Merges::none;
    ReplayPairing replay = ReplayPairing::no_replay;
    References references = References::none;
};

}  // namespace ambilux
