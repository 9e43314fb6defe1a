// What settings have an effect on: each variant of an integrator states it in its folder (variant.h).
#pragma once

namespace ambilux {

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
    bool streams = false;          ///< a wave holds more paths than it has slots
    bool in_double = false;        ///< has a twin in double precision (render/twin/twin.h)
    bool finds_all_light = false;  ///< with its default settings: may make references
};

}  // namespace ambilux
