// All that decides an image, apart from the scene. How each field is called, parsed, printed, explained and where it
// applies is declared once, in the table of settings.cpp.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "queues/order.h"
#include "queues/wave.h"
#include "scene/texture_memory.h"
#include "transport/mis/estimator.h"
#include "transport/mis/heuristic_name.h"
#include "transport/mis/strategy.h"

namespace ambilux {

/// Stages that run as parts of others. Images are the same.
enum class Fuse : uint32_t {
    automatic,  ///< what is fastest on the backend (backends/fusion.h)
    none,       ///< every stage is a kernel with a queue; kernels hold all features
};

/// How eye vertices draw light vertices from a cache (variant lvc).
enum class CacheDraws : uint32_t {
    automatic,    ///< coherent on a device, independent on a host
    coherent,     ///< lanes of a warp draw vertices that lie together
    independent,  ///< each draws by itself
};

/// Where a render runs.
enum class Backend : uint32_t { automatic, cpu, cuda };

/// Numbers that paths are computed with.
enum class Precision : uint32_t {
    single,    ///< floats
    in_double  ///< by the renderer's twin (render/twin/twin.h)
};

/// The structure that rays are traced through: of a host Embree's (automatic) or the one built for CUDA, of a device
/// the latter (automatic) or a binary BVH to compare with.
enum class AccelKind : uint32_t { automatic, embree, cwbvh, bvh2, optix };

/// How that of CUDA is built.
enum class Build : uint32_t {
    automatic,  ///< fast on a device, for scenes of many triangles (may_build_fast); else good
    fast,       ///< in a small part of the time (backends/fast_build.h)
    good,       ///< for long renders
};

/// An enumeration to which the names of its setting can be assigned.
template <class E>
class Choice {
public:
    using Enum = E;

    Choice(E value) : value_(value) {}
    Choice(const std::string& name);
    Choice(const char* name) : Choice(std::string(name)) {}
    operator E() const { return value_; }

private:
    E value_;
};

/// Highest probability of survival of Russian roulette unless asked otherwise, as in Mitsuba.
constexpr float kRouletteCap = 0.95f;

/// What bdpt.auto=true may choose.
enum class Allow : uint32_t {
    unbiased,
    consistent,  ///< and what is biased, but converges to the right image
};

/// What bdpt.auto=true chooses for.
enum class Selector : uint32_t {
    image,       ///< one candidate for all pixels
    efficiency,  ///< and numbers of connections for each pixel (variant aware)
};

/// How next event estimation picks an emitter. Light subpaths begin by the scene's table in either case.
enum class LightPicks : uint32_t {
    table,  ///< by the table of the scene, which was loaded by power or uniform, whatever the receiver
    tree,   ///< by what lights can bring to the receiver (scene/light_tree.h)
};

/// Where the random numbers of subpaths come from.
enum class Sampler : uint32_t {
    independent,  ///< each by itself (core/rng.h)
    sobol,        ///< shuffled, Owen-scrambled Sobol' points (core/sobol.h): samples of a pixel depend on each other
};

struct RenderSettings {
    std::string integrator = "path", variant = "wavefront";  ///< names of a Variant (registry.h)
    Choice<Backend> backend = Backend::automatic;
    Precision precision = Precision::single;
    Estimator estimator = Estimator::mis;
    LightPicks light_picking = LightPicks::table;
    Sampler sampler = Sampler::independent;
    MisHeuristic heuristic = MisHeuristic::balance;
    uint32_t strategies = kAllStrategies;  ///< StrategyBits
    SingleStrategies singles;              ///< if on, these and not the groups
    uint32_t technique_depth = 0;          ///< segments up to which images of single strategies are gathered
    bool automatic = false;                ///< a pilot chooses strategies, variant and connections
    Allow allow = Allow::unbiased;         ///< from among what
    Selector selector = Selector::image;
    uint32_t connections = 3;  ///< light vertices that an eye vertex draws
    CacheDraws draws = CacheDraws::automatic;
    uint32_t light_subpaths_per_tile = kTilePixels;  ///< per pixel in multiples of 1/kTilePixels
    int max_depth = -1;                              ///< segments of a path; -1 is unbounded
    int rr_depth = 5;                                ///< Russian roulette starts at this many segments; < 0: never
    float rr_cap = kRouletteCap;                     ///< its highest probability of survival
    uint64_t seed = 0;
    Choice<AccelKind> accel = AccelKind::automatic;
    Build build = Build::automatic;
    uint64_t memory = 0;  ///< most bytes of a render (render/wave_plan.h); 0: what there is
    TextureMemory textures = TextureMemory::device;
    uint32_t wave_size = 0;  ///< paths in flight; 0 chooses
    QueuePolicy queues = {Compaction::atomic, Ordering::automatic};
    bool specialise = true;  ///< kernels hold only what the scene has
    Fuse fuse = Fuse::automatic;
    float cull = 0.0f;  ///< cull_factor; 0: none
    bool tail = true;   ///< multi-bounce launches (stages/multi_bounce.h)
    bool deterministic = false;
    bool graph = true;  ///< cuda: one graph per wave; false launches kernel by kernel

    /// Settings that a variant declares for itself, by key; own_settings (setting.h) turns them into its struct.
    std::map<std::string, std::string> own;

    /// Of every pixel, that will be asked for; 0: not known. Waves that are chosen for a device are no larger.
    uint64_t expected_samples = 0;
    /// That the render is to take at least; 0: not known. If both are known, it goes on until it has both.
    double expected_seconds = 0;
    /// What build=auto may do. Experiments leave it.
    bool may_build_fast = false;
};

/// What was to be chosen is: no setting of bdpt.auto is left.
inline void end_selection(RenderSettings& settings) {
    settings.automatic = false;
    settings.allow = Allow::unbiased;
    settings.selector = Selector::image;
}

/// Sets one setting from text; throws Error(usage) that names the key, the value and what is allowed.
void apply_setting(RenderSettings& settings, const std::string& key, const std::string& value);

/// The value of a setting as apply_setting takes it.
std::string setting_text(const RenderSettings& settings, const std::string& key);

}  // namespace ambilux
