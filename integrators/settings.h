// All that decides an image, apart from the scene.
#pragma once

#include <cstdint>
#include <string>

#include "queues/order.h"
#include "queues/wave.h"
#include "transport/mis/strategy.h"
#include "transport/mis/unidirectional.h"

namespace ambilux {

/// Stages that run as parts of others. Images are the same.
enum class Fuse : uint32_t {
    automatic,  ///< what is fastest on the backend (render/fusion.h)
    none,       ///< every stage is a kernel with a queue; kernels hold all features
};

/// How eye vertices draw light vertices from a cache (variant lvc).
enum class CacheDraws : uint32_t {
    automatic,    ///< coherent on a device, independent on a host
    coherent,     ///< lanes of a warp draw vertices that lie together
    independent,  ///< each draws by itself
};

/// All that decides the image, apart from the scene. Every `--set KEY=VALUE` names a field here.
struct RenderSettings {
    std::string integrator = "path";
    std::string variant = "wavefront";
    std::string backend = "auto";  ///< auto, cpu, cuda
    Estimator estimator = Estimator::mis;
    MisHeuristic heuristic = MisHeuristic::balance;
    uint32_t strategies = kAllStrategies;  ///< bdpt: StrategyBits
    SingleStrategies singles;              ///< bdpt: if on, these and not the groups
    uint32_t technique_depth =
        0;  ///< light, bdpt: segments up to which images of single strategies are gathered (Renderer::strategy_images)
    uint32_t connections = 3;                        ///< bdpt, variant lvc: light vertices that an eye vertex draws
    CacheDraws draws = CacheDraws::automatic;        ///< bdpt, variant lvc
    uint32_t light_subpaths_per_tile = kTilePixels;  ///< key light_paths: light subpaths per pixel in multiples of
                                                     ///< 1/kTilePixels; light, bdpt: lvc or without connections
    int max_depth = -1;                              ///< segments of a path; -1 is unbounded
    int rr_depth = 5;  ///< Russian roulette starts at this many segments; a value < 0 turns it off
    uint64_t seed = 0;
    std::string accel = "auto";  ///< cpu: embree (auto) or cwbvh (the CUDA traversal built for the host). cuda: cwbvh
                                 ///< (auto) or, for integrator path, bvh2
    uint32_t wave_size = 0;      ///< paths in flight; 0 chooses
    uint64_t expected_samples =
        0;  ///< that will be asked for, of every pixel; 0: not known. Waves that are chosen for a device are no larger
    double expected_seconds =
        0;  ///< that the render is to take at least; 0: not known. If both are known, it goes on until it has both
    QueuePolicy queues = {Compaction::atomic, Ordering::automatic};  ///< keys compaction and ordering: where items lie
                                                                     ///< and in which order stages go through them
    bool specialise = true;                                          ///< kernels hold only what the scene has
    Fuse fuse = Fuse::automatic;  ///< which stages pass their items on without a queue
    float cull = 0.0f;            ///< Russian roulette before shadow rays (cull_factor); 0: none
    bool tail = true;  ///< cuda: the last subpaths of a wave take several bounces in one launch (stages/multi_bounce.h)
    bool deterministic = false;
    bool automatic = false;  ///< bdpt: a pilot chooses strategies, variant and connections (bdpt.auto)
    bool graph = true;  ///< cuda: one graph per wave; false launches kernel by kernel, for profilers and sanitizers
};

/// Sets one field from text; throws Error(usage) that names the key, the value and what is allowed.
void apply_setting(RenderSettings& settings, const std::string& key, const std::string& value);

/// The strategies of a render as key strategies takes them; of the path tracer, which has none, nothing.
std::string strategies_text(const RenderSettings& settings);

}  // namespace ambilux
