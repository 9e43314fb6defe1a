// How large the waves of a device are.
#pragma once

#include <algorithm>

#include "integrators/integrator.h"

namespace ambilux {

/// Paths of one wave from which on more bring less than 5 %, measured on scenes of short paths and long ones
/// (docs/performance.md): the last bounces, which few paths reach, cost as much for few as for many.
constexpr uint32_t kWavePlateau = 1u << 26;
/// With light vertices, which take half a kilobyte each beside.
constexpr uint32_t kFilmWidePlateau = 1u << 25;
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

/// Throws Error(device) that names the ways out of `needed` bytes for a wave of `paths`, more than are free.
[[noreturn]] void refuse_wave(uint64_t needed, uint64_t free, uint32_t paths);

/// How far waves have come that go through the film tile by tile.
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
