#include "render/device_plan.h"

#include <algorithm>

#include "core/error.h"
#include "render/wave_plan.h"

namespace ambilux {

DevicePlan::DevicePlan(const Scene& scene, const RenderSettings& settings, WavePolicy& waves, bool film_wide)
    : scene_(scene), settings_(settings), waves_(waves), film_wide_(film_wide) {}

uint32_t DevicePlan::light_subpaths(uint32_t tile) const {
    return in_parts() ? light_subpaths_in(wave, tile, wave.tiles, waves_.light_subpaths_per_tile) : light_subpaths_;
}

uint32_t DevicePlan::kept() const {
    return waves_.keeps_light_vertices ? planned_light_vertices(mean, waves_.most_light_subpaths(wave.slot_count()))
                                       : 0;
}

void DevicePlan::keep(uint64_t vertices) {
    mean = std::max(mean, double(vertices) / double(waves_.most_light_subpaths(wave.slot_count())));
}

void DevicePlan::shape(uint32_t size) {
    size_ = size;
    const WaveState* const state = wave.state;
    wave = shape_wave(scene_, settings_.seed, size, ~0u);
    wave.state = state;
    film_wave = wave;
    const uint32_t all = tile_count(wave);
    if (film_wide_) film_wave.tiles = all;
    if (streams()) {
        wave.tiles = all;
        waves_.slots_in_flight = size;
        wave.samples = film_wave.samples =
            stream_samples(size, all * kTilePixels, settings_.expected_samples, waves_.most_paths);
    }
    light_subpaths_ = light_subpaths_in(wave, 0, wave.tiles, waves_.light_subpaths_per_tile);
    waves_.multi_bounce_below = multi_bounce_below(settings_, wave.slot_count());
}

void DevicePlan::shape_least() { shape(least_size()); }

void DevicePlan::shape_preferred(uint64_t bytes_per_path, uint64_t room) {
    const uint32_t plateau = streams() ? kStreamPlateau : film_wide_ ? kFilmWidePlateau : kWavePlateau;
    const uint32_t size = device_wave_size(scene_, settings_, plateau, bytes_per_path, room);
    const bool whole = film_wide_ && !streams();
    shape(whole ? std::max(size, tile_count(shape_wave(scene_, 0, size, 1)) * kTilePixels) : size);
}

bool DevicePlan::fit(uint64_t room, const std::function<uint64_t()>& needed) {
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

void DevicePlan::check_numbers() const {
    if (uint64_t(light_subpaths_) * wave.samples > 0xffffffffull)
        throw Error(ExitCode::usage, "wave_size=" + std::to_string(settings_.wave_size) +
                                         ": more light subpaths than can be numbered; set a smaller one, or fewer "
                                         "light_paths");
}

}  // namespace ambilux
