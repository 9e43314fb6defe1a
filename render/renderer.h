// The host's handle on a render in progress: one integrator, one scene, one backend.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "film/device_image.h"
#include "film/moments.h"
#include "film/tone.h"
#include "integrators/settings.h"
#include "integrators/state_kind.h"
#include "scene/scene.h"

namespace ambilux {

/// What one stage did.
struct StageStats {
    std::string name;
    uint64_t launches = 0, items = 0;
    double seconds = 0;
    std::vector<uint64_t> items_by_depth;  ///< index = depth (segments); the last entry gathers all deeper ones
};

/// Counts of values that were dropped or lost.
struct InvalidCounts {
    uint64_t nan = 0, inf = 0, negative = 0;
    /// Contributions that their weight took below the range of floats. No error by themselves: tails of narrow lobes
    /// are as small.
    uint64_t underflow = 0;
    uint64_t total() const { return nan + inf + negative; }
};

struct QueueStats {
    std::string name;
    uint64_t capacity = 0, peak = 0, overflow = 0;
};

/// How bdpt.auto=true chose.
struct SelectionStats {
    struct Candidate {
        std::string name, settings;
        double variance;       ///< of one sample of a pixel, relative to its squared mean; infinite if it is excluded
        double work;           ///< of one sample, in rays
        double seconds;        ///< of one sample of all pixels; 0 where it was not measured
        double efficiency;     ///< 1 / (variance · cost) over that of the selection
        std::string excluded;  ///< why it cannot be selected (render/selection.cpp); empty if it can
    };
    std::string name;                                           ///< of the selection; empty if there was none
    std::vector<std::pair<std::string, std::string>> settings;  ///< with them the same estimator runs again
    double seconds = 0;                                         ///< that the selection took
    uint32_t pilot_samples = 0;
    double expected_samples = 0;  ///< of every pixel: what was optimised for (integrators/auto/pilot.h)
    std::vector<Candidate> candidates;
};

struct RenderStats {
    std::string backend, device, accel;
    RenderSettings settings;    ///< as used: bdpt.auto has chosen some of them, and others were left open
    double device_seconds = 0;  ///< driver and context, when this process first looked for a device; not in `build`
    double build_seconds = 0;   ///< acceleration structure, upload, allocation, kernels
    double structure_seconds = 0, kernel_seconds = 0;  ///< parts of it; with graph=false kernels are part of render
    double render_seconds = 0;                         ///< inside render(), wall clock
    uint64_t samples = 0;                              ///< per pixel
    uint32_t wave_paths = 0;  ///< in flight at once in a wave (on a CPU each thread has one); 0: no waves
    uint64_t rays_extend = 0, rays_occlude = 0;
    std::vector<StageStats> stages;
    std::vector<QueueStats> queues;
    InvalidCounts invalid;
    std::map<std::string, InvalidCounts> invalid_by_stage;
    uint64_t memory_bytes = 0;            ///< allocated for this render (scene, structure, queues, film)
    uint64_t memory_bytes_predicted = 0;  ///< computed before the allocation
    uint64_t memory_bytes_peak = 0;       ///< the most at any time
    std::vector<std::string> features;    ///< what the kernels contain
    SelectionStats selection;
    std::vector<std::string> skipped;  ///< stages and kernel parts that this scene does not need
};

/// What one strategy found, mean over the samples rendered so far: width x height x 3 values, row-major from the top
/// left.
struct StrategyImage {
    uint32_t s, t;                     ///< vertices of the light and of the eye subpath
    bool merge;                        ///< they merge at a vertex that both count
    std::vector<float> raw, weighted;  ///< without and with the weight of multiple importance sampling
    uint64_t dropped;                  ///< values left out as not finite
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
    /// Takes the film away and leaves an empty one. The function gives it, once, on any thread while this renders on;
    /// before the next call.
    virtual std::function<FilmMoments()> take_film() {
        std::function<FilmMoments()> taken = [film = film()]() mutable { return std::move(film); };
        clear_film();
        return taken;
    }
    /// Means of the same samples without a way over the host; nothing where the film lies on the host.
    virtual std::optional<DeviceImage> device_image() { return std::nullopt; }
    /// What is to be seen of them: means times 2^stops. Of a film on a device it is made there, and the bytes alone
    /// come to the host.
    virtual ByteImage picture(float stops) {
        const FilmMoments film = this->film();
        return tone_mapped(film.sum.data(), film.width, film.height, film.samples, stops);
    }
    /// Begins anew, statistics too, with the scene's sensor, which has changed in place but for its size. False, and
    /// nothing done, where that takes another renderer.
    virtual bool move_camera() { return false; }
    /// From now on render() may leave a sample unfinished once *flag is true. It returns fewer samples then, and the
    /// film is lost: only move_camera() makes another.
    virtual void give_up_when(const volatile bool* /*flag*/) {}
    /// Samples that were rendered while the renderer was made: a first call of render(0, count) with at least so many
    /// adds them at no cost.
    virtual uint32_t ready() const { return 0; }
    virtual RenderStats stats() = 0;
    /// With RenderSettings::technique_depth: images of all strategies up to there. Sums of all samples since the start,
    /// cleared films included.
    virtual std::vector<StrategyImage> strategy_images() { return {}; }
    /// What a method keeps between iterations: saved with the film, a render goes on from it as if it had not been
    /// interrupted. Empty, and nothing to load, for most methods.
    virtual StateKind state_kind() const { return StateKind::none; }
    virtual std::vector<std::byte> save_state() { return {}; }
    /// Before the first sample that is rendered. Throws Error(bad_input) if it was saved by another render.
    virtual void load_state(std::span<const std::byte>) {}
    /// Samples of every pixel in one iteration: `first` and `count` of render() are multiples of it.
    virtual uint32_t iteration_samples() const { return 1; }
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
