#include "render/device_wave.h"

#include <fmt/format.h>

#include "core/error.h"

namespace ambilux {

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
                       !settings.queues.fixed_places() && settings.accel != AccelKind::bvh2;
    return settings.tail && suits ? std::min(kMultiBounceBelow, slots / kBouncesPerLaunch) : 0;
}

void refuse_wave(uint64_t needed, uint64_t free, uint32_t paths) {
    throw Error(
        ExitCode::device,
        fmt::format("this render needs {} MiB on the device, and {} MiB are free: try a smaller --size or --set "
                    "wave_size=N (now {} paths)",
                    needed >> 20, free >> 20, paths));
}

}  // namespace ambilux
