// What a method is to the renderer (concept Integrator, integrators/contract.h): a template
//   template <Features F, class Tracer, Fusion kFusion> struct NAMEIntegrator
// that says what it decides on the host (Policy, plan), which queues a wave has (Memory, lay_out), what lives longer
// than a wave (State), what works on them (Stages), and in which order (schedule or iteration).
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "film/strategy_film.h"
#include "integrators/kept_state.h"
#include "integrators/settings.h"
#include "queues/order.h"
#include "queues/primitives.h"
#include "scene/scene.h"
#include "stages/multi_bounce.h"
#include "stages/update_film.h"

namespace ambilux {

/// What every integrator decides.
struct WavePolicy {
    QueuePolicy queues;
    uint32_t multi_bounce_below = 0;  ///< on a device: fewer subpaths than this take several bounces in one launch
    float cull = 0;                   ///< cull_factor; 0: none
    uint32_t strategy_depth = 0;      ///< segments up to which images of single strategies are gathered; 0: none
    bool strategy_merges = false;     ///< merges are among them
    bool deterministic = false;
    uint32_t slots_in_flight = 0;          ///< that take one path of a wave after the other, as many as the renderer
                                           ///< finds right; 0: every path has a slot of its own
    uint32_t most_paths = ~0u;             ///< of a wave, as items can number them
    uint32_t light_subpaths_per_tile = 0;  ///< of kTilePixels pixels, in one sample; 0: none
    uint32_t iteration_samples = 1;        ///< of every pixel in one iteration
    uint32_t iterations_together = 1;      ///< iterations that are done at once, at most: the renderer takes as many as
                                           ///< fill a machine
    uint64_t iteration_light_subpaths = ~0ull;  ///< of an iteration, at most: those beyond are not begun
    bool keeps_light_vertices = false;          ///< queues of light vertices or splats hold those of a whole wave

    uint32_t strategy_images() const { return StrategyFilm::images(strategy_depth, strategy_merges); }
    /// Most light subpaths of a slot.
    uint32_t light_rounds() const { return (light_subpaths_per_tile + kTilePixels - 1) / kTilePixels; }
    /// Light subpaths of `slots`, a multiple of kTilePixels, if all of them are active.
    uint64_t most_light_subpaths(uint32_t slots) const {
        return std::min(uint64_t(slots / kTilePixels) * light_subpaths_per_tile, iteration_light_subpaths);
    }
    /// The most items that a stage goes through in order (OrderMemory::slots).
    uint32_t order_slots(uint32_t slots) const { return slots_in_flight ? slots_in_flight : slots; }
};

/// Buffers of the film that a wave works on. `samples`: by slot of this wave.
struct FilmBuffers {
    Lane* samples;
    SplatSums splats;
    FilmSums sums;
    double* strategies = nullptr;  ///< StrategyFilm
    uint64_t* strategies_dropped = nullptr;
};

/// How much a wave holds, and what the primitives of its executor need.
struct WaveSize {
    uint32_t slots;
    uint32_t kept;  ///< vertices of its light subpaths
    PrimitiveBytes primitives = {};
};

/// What the stages of a wave are made of, beside what their method lays out.
template <class Tracer>
struct WaveParts {
    Layout& layout;  ///< of the wave: its records
    const SceneView& scene;
    const Tracer& tracer;
    const Wave& wave;
    const FilmBuffers& film;
};

/// Room for the light vertices of so many subpaths, from the mean of the pilot: a quarter more, and six deviations of a
/// geometric distribution.
inline uint32_t planned_light_vertices(double mean, uint64_t subpaths) {
    const double n = double(subpaths);
    return uint32_t(std::min(1.25 * mean * n + 6.0 * std::sqrt(n * mean * (mean + 1.0)) + 64.0, 4.0e9));
}

/// Throws Error(usage) when subpaths might never end.
void check_depths(const RenderSettings& settings);
/// Segments and roulette as kernels count them.
uint32_t segment_limit(const RenderSettings& settings);
uint32_t roulette_depth(const RenderSettings& settings);

/// Names of kernel parts that this scene does without.
void skipped_features(const Features& kernels, std::vector<std::string>& parts);

/// Which tiles and samples fit into a wave of about `wave_size` paths. Throws Error(usage) if slots would not fit 32
/// bits.
Wave shape_wave(const Scene& scene, uint64_t seed, uint32_t wave_size, uint32_t max_tiles);
/// Tiles of the whole film.
uint32_t tile_count(const Wave& wave);

}  // namespace ambilux
