// Which pixels and samples the waves of a render hold, and how they get smaller where memory is short: by one rule for
// all methods and backends.
#pragma once

#include <functional>

#include "backends/scene_fit.h"
#include "integrators/integrator.h"

namespace ambilux {

/// What the setting `memory` counts: on a device, all that is allocated there but for what the driver keeps for itself
/// (its context, kernels and their stacks, graphs); on the CPU, the scene, the acceleration structure, the film and the
/// waves of all threads, but neither what only loading and building take, nor copies of the film on their way to a
/// file.
struct RenderBytes {
    SceneBytes scene;
    uint64_t accel, film, waves;

    uint64_t total() const { return scene.total() + accel + film + waves; }
};

/// The largest of `least` to `most` for which `fits`, which holds for all smaller ones if for one; 0 if for none.
uint32_t largest_that_fits(uint32_t least, uint32_t most, const std::function<bool(uint32_t)>& fits);

/// Throws Error(device) with the bytes of each part of `least`, the smallest render that would work, which are more
/// than settings.memory.
[[noreturn]] void refuse_budget(const RenderSettings& settings, const RenderBytes& least);
/// Throws Error(device): the host has no memory for a render of `scene`.
[[noreturn]] void refuse_film(const Scene& scene);
/// Throws Error(usage): samples [first, first + count) are no whole iterations of `k` samples.
[[noreturn]] void refuse_samples(const RenderSettings& settings, uint32_t k, uint32_t first, uint32_t count);
/// Throws Error(device) that names the ways out of `needed` bytes for a wave of `paths`, more than are free.
[[noreturn]] void refuse_wave(uint64_t needed, uint64_t free, uint32_t paths);

/// For a method whose light may land anywhere on the film (`film_wide`) a sample is complete when all of it is. The
/// waves of a device hold the whole film, or, where there is no memory for that, parts of it one after the other; those
/// of a host are small, so that a wave stays in a core's cache.
class WavePlan {
public:
    /// `threads`: of a host, each of which has a wave; 0: a device. `whole_iterations`: waves hold all samples of an
    /// iteration. `waves` is told what depends on the size of a wave, and must outlive the plan.
    WavePlan(const Scene& scene, const RenderSettings& settings, WavePolicy& waves, bool film_wide, uint32_t threads,
             bool whole_iterations);

    Wave wave{};       ///< in flight
    Wave film_wave{};  ///< added to the film at once
    double mean = 0;   ///< light vertices of a light subpath that queues are planned for

    bool streams() const { return waves_.slots_in_flight > 0; }
    /// A wave holds a part of the film.
    bool in_parts() const { return film_wide_ && wave.tiles < tile_count(wave); }
    /// Light subpaths of a wave from `tile` on, in one sample.
    uint32_t light_subpaths(uint32_t tile) const;
    /// Light vertices that the queues of a wave have room for.
    uint32_t kept() const;
    /// Light subpaths of the iterations that are done at once.
    uint64_t light_subpaths_together() const;
    /// A wave of this shape had so many: plans for no fewer from now on.
    void keep(uint64_t vertices);

    /// Decides how many iterations are done at once: as many as fill the machine, while `fits()` with all of them in a
    /// wave of a device.
    void choose_iterations(const std::function<bool()>& fits);
    /// The smallest wave that may be: what was set, where it was.
    void shape_least() { shape(least_size()); }
    /// A wave that does well, on a device in about `room` bytes of a budget, or in half of what is free without one.
    void shape_preferred(uint64_t bytes_per_path, uint64_t room);
    /// Makes the wave smaller until needed() bytes fit into `room`. A size that was set stays, but for what was added
    /// to it to have the whole film in one wave. False, with the smallest wave, if that does not fit.
    bool fit(uint64_t room, const std::function<uint64_t()>& needed);

private:
    /// A wave of `size` slots. Paths of streaming are many more than its slots, and always those of the whole film.
    void shape(uint32_t size);
    /// Of the film, in all iterations that are done at once.
    uint64_t slots_together() const;
    void shape_on_host();
    void shape_on_device();
    void check_numbers() const;
    uint32_t least_size() const { return settings_.wave_size ? settings_.wave_size : kTilePixels; }

    const Scene& scene_;
    const RenderSettings& settings_;
    WavePolicy& waves_;
    bool film_wide_, whole_iterations_;
    uint32_t threads_;
    uint32_t size_ = 0;            ///< of shape()
    uint32_t light_subpaths_ = 0;  ///< of the whole film, in one sample
};

// ---- waves of a host ----

/// Paths of one wave: with the surfaces and texels that they meet, about 1 KiB each, they stay in a core's second-level
/// cache from stage to stage.
constexpr uint32_t kHostWaveSize = 512;

/// A wave of about `size` paths, or of as many as do well (0). Enough waves that `threads` end together.
Wave host_wave(const Scene& scene, const RenderSettings& settings, uint32_t threads, uint32_t size = 0);

// ---- waves of a device ----

/// Paths of one wave from which on more bring less than 5 %, measured on scenes of short paths and long ones
/// (docs/performance.md): the last bounces, which few paths reach, cost as much for few as for many.
constexpr uint32_t kWavePlateau = 1u << 26;
/// With light vertices, which take half a kilobyte each beside.
constexpr uint32_t kFilmWidePlateau = 1u << 25;
/// Where iterations have a number of samples of their own, as many of them are done at once as have so many paths.
constexpr uint32_t kIterationsPlateau = 1u << 22;
/// Slots of streaming: twice as many bring 3 to 8 %, but it is there to need little memory.
constexpr uint32_t kStreamPlateau = 1u << 23;

/// Paths of a wave where `settings` leave it open: `plateau`, from which on more do not pay, or as many as the render
/// has, or as fit into `room` bytes.
uint32_t device_wave_size(const Scene& scene, const RenderSettings& settings, uint32_t plateau, uint64_t bytes_per_path,
                          uint64_t room);

/// Samples of a wave of variant streaming: enough paths for each of `slots` that the last ones, which leave slots idle,
/// matter little. `paths`: of a sample; `expected`: samples of the render, 0 if not known; `most`: paths of a wave.
uint32_t stream_samples(uint32_t slots, uint32_t paths, uint64_t expected, uint32_t most);

/// WavePolicy::multi_bounce_below, for waves of `slots`. Several bounces may bring several contributions of a path in
/// one launch: their sums depend on the order of threads, and queues have room for that many only where items are
/// appended. Stages that pass light on without queues do not need that room.
uint32_t multi_bounce_below(const RenderSettings& settings, uint32_t slots);

/// BdptPolicy::traces_connections: where one thread may have all pairs of a path, their rays need not be sorted, and
/// the acceleration structure of `bytes` is small. Kernels for it are there for some features only.
template <class Policy>
bool traces_connections(const Policy& policy, uint64_t bytes) {
    constexpr uint64_t kTracedInPlace = 4096;
    const WavePolicy& w = policy.waves;
    return w.strategy_depth == 0 && !w.deterministic && !w.queues.fixed_places() &&
           w.queues.ordering != Ordering::morton && bytes <= kTracedInPlace;
}

/// Where waves that go through the film tile by tile, sample after sample, stand.
struct WaveProgress {
    uint32_t samples;    ///< of every pixel that are finished, in whole waves
    uint32_t next_tile;  ///< of the sample after them
};
/// After `waves` that began with sample 0 at `first_tile`.
WaveProgress progress_of(const Wave& wave, uint32_t first_tile, uint32_t waves);

/// `batch` samples in whole waves of `wave_samples`, at least one: the last depths of a wave cost as much for few paths
/// as for many.
inline uint32_t whole_waves(uint32_t batch, uint32_t wave_samples) {
    return (batch + wave_samples - 1) / wave_samples * wave_samples;
}

/// Samples of the next waves, at most `pass`, where waves learn from those before them, after `done` samples: the first
/// waves are small.
inline uint32_t learning_pass(uint32_t pass, uint64_t done, uint32_t wave_samples) {
    return done >= wave_samples ? pass : std::min(pass, std::max(1u, uint32_t(done)));
}

}  // namespace ambilux
