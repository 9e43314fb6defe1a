// The host's handle on a render in progress: one integrator, one scene, one backend.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "film/moments.h"
#include "queues/order.h"
#include "scene/scene.h"
#include "stages/path_policy.h"
#include "stages/techniques.h"
#include "transport/bidirectional.h"

namespace ambilux {

/// Stages that run as parts of others. Images are the same.
enum class Fuse : uint32_t {
    automatic,  ///< what is fastest on the backend
    none,       ///< every stage is a kernel with a queue
    light,      ///< mis_weight and accumulate are parts of the stages that find the light
    all  ///< also connect is a part of shade; on a device generate of extend, and the shadow rays of connect_vertices
         ///< of it where the structure is small (kTracedInPlace); on a host, for bdpt, connect_vertices and occlude of
         ///< the stages that make their items
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
        0;  ///< light, bdpt: segments up to which images of single strategies are gathered (Renderer::technique_images)
    uint32_t connections = 3;                     ///< bdpt, variant lvc: light vertices that an eye vertex draws
    uint32_t light_walks_per_tile = kTilePixels;  ///< key light_paths: light walks per pixel in multiples of
                                                  ///< 1/kTilePixels; light, bdpt: lvc or without connections
    int max_depth = -1;                           ///< segments of a path; -1 is unbounded
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
    float cull = 0.0f;            ///< Russian roulette before shadow rays (survival_factor); 0: none
    bool tail = true;  ///< cuda: the last walks of a wave go on for several depths in one launch (stages/tail.h)
    bool deterministic = false;
    bool automatic = false;  ///< bdpt: a pilot chooses strategies, variant and connections (bdpt.auto)
    bool graph = true;  ///< cuda: one graph per wave; false launches kernel by kernel, for profilers and sanitizers
};

/// Sets one field from text; throws Error(usage) that names the key, the value and what is allowed.
void apply_setting(RenderSettings& settings, const std::string& key, const std::string& value);

/// The strategies of a render as key strategies takes them; of the path tracer, which has none, nothing.
std::string strategies_text(const RenderSettings& settings);

/// What one stage did.
struct StageStats {
    std::string name;
    uint64_t launches = 0, items = 0;
    double seconds = 0;
    std::vector<uint64_t> items_by_depth;  ///< index = depth (segments); the last entry gathers all deeper ones
};

/// Counts of dropped values.
struct InvalidCounts {
    uint64_t nan = 0, inf = 0, negative = 0;
    uint64_t total() const { return nan + inf + negative; }
};

struct QueueStats {
    std::string name;
    uint64_t capacity = 0, peak = 0, overflow = 0;
};

/// How bdpt.auto=true chose.
struct ChoiceStats {
    struct Candidate {
        std::string name, settings;
        double variance;  ///< of one sample of a pixel, relative to its squared mean; infinite if some light cannot be
                          ///< found
        double work;      ///< of one sample, in rays
        double seconds;   ///< of one sample of all pixels; 0 where it was not measured
        double efficiency;  ///< 1 / (variance · cost) over that of the choice
    };
    std::string name;                                           ///< of the choice; empty if there was none
    std::vector<std::pair<std::string, std::string>> settings;  ///< with them the same estimator runs again
    double seconds = 0;                                         ///< that the choice took
    uint32_t pilot_samples = 0;
    double expected_samples = 0;  ///< of every pixel: what was optimised for (choice_pilot.h)
    std::vector<Candidate> candidates;
};

struct RenderStats {
    std::string backend, device, accel;
    QueuePolicy queue_policy;   ///< as used
    Fuse fuse = Fuse::none;     ///< as used
    double build_seconds = 0;   ///< acceleration structure, upload, allocation
    double render_seconds = 0;  ///< inside render(), wall clock
    uint64_t samples = 0;       ///< per pixel
    uint64_t rays_extend = 0, rays_occlude = 0;
    std::vector<StageStats> stages;
    std::vector<QueueStats> queues;
    InvalidCounts invalid;
    std::map<std::string, InvalidCounts> invalid_by_stage;
    uint64_t memory_bytes = 0;            ///< allocated for this render (scene, structure, queues, film)
    uint64_t memory_bytes_predicted = 0;  ///< computed before the allocation
    std::vector<std::string> features;    ///< what the kernels contain
    ChoiceStats choice;
    std::vector<std::string> skipped;  ///< stages and kernel parts that this scene does not need
};

/// What one strategy found, mean over the samples rendered so far: width x height x 3 values, row-major from the top
/// left.
struct TechniqueImage {
    uint32_t s, t;
    std::vector<float> raw, weighted;  ///< without and with the weight of multiple importance sampling
    uint64_t dropped;                  ///< values left out as no numbers or too large for the sums
};

/// A render in progress. Not thread-safe; `interrupt` may be set from a signal handler.
class Renderer {
public:
    virtual ~Renderer() = default;
    /// Adds samples [first, first+count) of every pixel to the film. Returns the samples per pixel that were finished:
    /// `count`, or fewer when *interrupt became true; what was finished is complete for every pixel.
    virtual uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt = nullptr) = 0;
    /// Sums over all samples rendered so far, per pixel of the crop.
    virtual FilmMoments film() = 0;
    virtual void clear_film() = 0;
    /// Samples that were rendered while the renderer was made: a first call of render(0, count) with at least so many
    /// adds them at no cost.
    virtual uint32_t ready() const { return 0; }
    virtual RenderStats stats() = 0;
    /// With RenderSettings::technique_depth: images of all strategies up to there. Sums of all samples since the start,
    /// cleared films included.
    virtual std::vector<TechniqueImage> technique_images() { return {}; }
    /// A count for render() after which a caller should look at clocks and signals again: about 0.2 s of work, at
    /// least 1.
    virtual uint32_t preferred_batch() const = 0;
};

/// Makes the renderer that `settings` names. The scene must outlive it. Throws Error(usage) for unknown names,
/// Error(device) if the backend is not available.
std::unique_ptr<Renderer> make_renderer(const Scene& scene, const RenderSettings& settings);

/// True if this build has the CUDA backend and a device answers.
bool cuda_available();

}  // namespace ambilux
