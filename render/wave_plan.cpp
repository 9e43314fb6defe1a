#include "render/wave_plan.h"

#include <fmt/format.h>

#include "core/error.h"
#include "integrators/parse_value.h"

namespace ambilux {

WavePlan::WavePlan(const Scene& scene, const RenderSettings& settings, WavePolicy& waves, bool film_wide,
                   uint32_t threads, bool whole_iterations)
    : scene_(scene), settings_(settings), waves_(waves), film_wide_(film_wide), whole_iterations_(whole_iterations),
      threads_(threads) {}

uint32_t WavePlan::light_subpaths(uint32_t tile) const {
    return in_parts() ? light_subpaths_in(wave, tile, wave.tiles, waves_.light_subpaths_per_tile) : light_subpaths_;
}

uint32_t WavePlan::kept() const {
    return waves_.keeps_light_vertices ? planned_light_vertices(mean, waves_.most_light_subpaths(wave.slot_count()))
                                       : 0;
}

uint64_t WavePlan::light_subpaths_together() const {
    return waves_.iterations_together *
           std::min(uint64_t(light_subpaths_) * waves_.iteration_samples, waves_.iteration_light_subpaths);
}

uint64_t WavePlan::slots_together() const {
    return uint64_t(tile_count(shape_wave(scene_, 0, kTilePixels, 1))) * kTilePixels *
           (whole_iterations_ ? waves_.iteration_samples * waves_.iterations_together : 1);
}

void WavePlan::choose_iterations(const std::function<bool()>& fits) {
    uint32_t& together = waves_.iterations_together;
    if (!whole_iterations_) together = 1;
    if (together == 1) return shape_least();
    const uint64_t paths = threads_ > 0              ? 4ull * threads_ * kHostWaveSize
                           : settings_.wave_size > 0 ? settings_.wave_size
                                                     : kIterationsPlateau;
    const uint64_t alone = slots_together() / together, asked = settings_.expected_samples / waves_.iteration_samples;
    together = uint32_t(std::clamp<uint64_t>(paths / alone, 1, together));
    if (asked > 0) together = uint32_t(std::min<uint64_t>(together, asked));
    for (;; together /= 2) {
        shape(threads_ == 0 && together > 1 ? uint32_t(slots_together()) : least_size());
        if (together == 1 || fits()) break;
    }
    shape_least();
}

void WavePlan::keep(uint64_t vertices) {
    mean = std::max(mean, double(vertices) / double(waves_.most_light_subpaths(wave.slot_count())));
}

void WavePlan::shape(uint32_t size) {
    size_ = size;
    const WaveState* const state = wave.state;
    if (threads_ > 0)
        shape_on_host();
    else
        shape_on_device();
    wave.state = film_wave.state = state;
    light_subpaths_ = light_subpaths_in(wave, 0, tile_count(wave), waves_.light_subpaths_per_tile);
}

void WavePlan::shape_on_host() {
    wave = host_wave(scene_, settings_, threads_, size_);
    if (film_wide_) wave.samples = 1;  // a sample is complete when all its waves are done
    film_wave = wave;
    film_wave.tiles = (tile_count(wave) + wave.tiles - 1) / wave.tiles * wave.tiles;
    if (whole_iterations_) film_wave.samples = waves_.iteration_samples * waves_.iterations_together;
    if (streams()) waves_.slots_in_flight = std::max(kTilePixels, wave.slot_count() / 4);
}

void WavePlan::shape_on_device() {
    wave = shape_wave(scene_, settings_.seed, size_, ~0u);
    const uint32_t all = tile_count(wave);
    if (whole_iterations_) {
        const uint32_t samples = waves_.iteration_samples;
        wave.tiles = std::clamp(size_ / (samples * kTilePixels), 1u, all);
        wave.samples = samples * std::clamp(size_ / (samples * kTilePixels * all), 1u, waves_.iterations_together);
    }
    film_wave = wave;
    film_wave.tiles = all;
    if (streams()) {
        wave.tiles = all;
        waves_.slots_in_flight = size_;
        wave.samples = film_wave.samples =
            stream_samples(size_, all * kTilePixels, settings_.expected_samples, waves_.most_paths);
    }
    waves_.multi_bounce_below = multi_bounce_below(settings_, wave.slot_count());
}

void WavePlan::shape_preferred(uint64_t bytes_per_path, uint64_t room) {
    if (threads_ > 0) return shape(settings_.wave_size ? settings_.wave_size : kHostWaveSize);
    const uint32_t plateau = streams() ? kStreamPlateau : film_wide_ ? kFilmWidePlateau : kWavePlateau;
    const uint32_t size =
        device_wave_size(scene_, settings_, plateau, bytes_per_path, settings_.memory ? room : room / 2);
    const bool whole = film_wide_ && !streams();
    shape(whole ? uint32_t(std::max<uint64_t>(size, slots_together())) : size);
}

bool WavePlan::fit(uint64_t room, const std::function<uint64_t()>& needed) {
    const uint32_t as_it_is = size_, most = std::max(1u, as_it_is / kTilePixels),
                   least = std::clamp(least_size() / kTilePixels, 1u, most);
    const auto fits = [&](uint32_t tiles) {
        shape(tiles == most ? as_it_is : tiles * kTilePixels);
        return needed() <= room;
    };
    const uint32_t best = largest_that_fits(least, most, fits);
    fits(std::max(best, least));
    check_numbers();
    return best > 0;
}

void WavePlan::check_numbers() const {
    if (uint64_t(light_subpaths_) * wave.samples > 0xffffffffull)
        throw Error(ExitCode::usage, "wave_size=" + std::to_string(settings_.wave_size) +
                                         ": more light subpaths than can be numbered; set a smaller one, or fewer "
                                         "light_paths");
}

Wave host_wave(const Scene& scene, const RenderSettings& settings, uint32_t threads, uint32_t size) {
    if (size == 0) size = settings.wave_size ? settings.wave_size : kHostWaveSize;
    const uint32_t tiles = tile_count(shape_wave(scene, settings.seed, kTilePixels, 1));
    return shape_wave(scene, settings.seed, size, std::max(1u, tiles / (8 * threads)));
}

uint32_t device_wave_size(const Scene& scene, const RenderSettings& settings, uint32_t plateau, uint64_t bytes_per_path,
                          uint64_t room) {
    if (settings.wave_size > 0) return settings.wave_size;
    const auto tiles = [](uint32_t pixels) { return uint64_t(pixels + kTileSide - 1) / kTileSide; };
    const uint64_t slots = tiles(scene.sensor.crop_width) * tiles(scene.sensor.crop_height) * kTilePixels;
    const bool fewer = settings.expected_samples > 0 && settings.expected_samples <= plateau / slots;
    return uint32_t(
        std::clamp<uint64_t>(room / bytes_per_path, kTilePixels, fewer ? slots * settings.expected_samples : plateau));
}

uint32_t stream_samples(uint32_t slots, uint32_t paths, uint64_t expected, uint32_t most) {
    uint64_t samples = std::min<uint64_t>(8ull * slots, most) / paths;
    if (expected > 0) samples = std::min(samples, expected);
    return uint32_t(std::max<uint64_t>(1, samples));
}

WaveProgress progress_of(const Wave& wave, uint32_t first_tile, uint32_t waves) {
    const uint32_t tiles = wave.tiles, all = tile_count(wave), per_sample = (all + tiles - 1) / tiles,
                   of_first = (all - first_tile + tiles - 1) / tiles;
    if (waves < of_first) return {0, first_tile + waves * tiles};
    const uint32_t rest = waves - of_first;
    return {(1 + rest / per_sample) * wave.samples, rest % per_sample * tiles};
}

uint32_t multi_bounce_below(const RenderSettings& settings, uint32_t slots) {
    const bool suits = !settings.deterministic && settings.technique_depth == 0 && settings.fuse != Fuse::none &&
                       !settings.queues.fixed_places() && settings.accel != AccelKind::bvh2 &&
                       settings.accel != AccelKind::optix;
    return settings.tail && suits ? std::min(kMultiBounceBelow, slots / kBouncesPerLaunch) : 0;
}

void refuse_wave(uint64_t needed, uint64_t free, uint32_t paths) {
    throw Error(
        ExitCode::device,
        fmt::format("this render needs {} MiB on the device, and {} MiB are free: try a smaller --size or --set "
                    "wave_size=N (now {} paths)",
                    needed >> 20, free >> 20, paths));
}

uint32_t largest_that_fits(uint32_t least, uint32_t most, const std::function<bool(uint32_t)>& fits) {
    if (most >= least && fits(most)) return most;
    if (most <= least || !fits(least)) return 0;
    uint32_t lower = least, upper = most;  // the first fits, the second does not
    while (upper - lower > 1) {
        const uint32_t middle = lower + (upper - lower) / 2;
        (fits(middle) ? lower : upper) = middle;
    }
    return lower;
}

void refuse_film(const Scene& scene) {
    throw Error(ExitCode::device,
                fmt::format("out of memory: a film of {}x{} needs more than there is; a smaller --size or wave_size "
                            "needs less",
                            scene.sensor.crop_width, scene.sensor.crop_height));
}

void refuse_samples(const RenderSettings& settings, uint32_t k, uint32_t first, uint32_t count) {
    throw Error(ExitCode::usage,
                fmt::format("spp: integrator {}, variant {}, has iterations of {} samples; samples {} to {} are no "
                            "whole ones",
                            settings.integrator, settings.variant, k, first, uint64_t(first) + count));
}

void refuse_budget(const RenderSettings& settings, const RenderBytes& least) {
    // Rounded up, so that what is named works.
    const auto mib = [](uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; };
    const bool texels = settings.textures == TextureMemory::device && least.scene.textures > 0;
    throw Error(ExitCode::device,
                fmt::format("memory={}: this render needs at least {}M: {} of geometry, {} of textures, {} of "
                            "acceleration structure, {} of the rest of the scene, {} of film, {} of waves{}. Give it "
                            "more memory, or a smaller --size{}",
                            text_of_bytes(settings.memory), mib(least.total()), mib(least.scene.geometry),
                            mib(least.scene.textures), mib(least.accel), mib(least.scene.rest), mib(least.film),
                            mib(least.waves), settings.wave_size ? fmt::format(" of {} paths", settings.wave_size) : "",
                            texels ? ", or, on a CUDA device, --textures host" : ""));
}

}  // namespace ambilux
