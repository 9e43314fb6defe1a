// What the method of mark_method.h should render, by a plain loop over all marks of an iteration.
#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "film/moments.h"
#include "tests/support/mark_method.h"

namespace ambilux::test {

inline RenderSettings mark_settings(const std::map<std::string, std::string>& own) {
    RenderSettings s;
    s.queues = {};
    s.deterministic = true;
    s.own = own;
    return s;
}

/// Calls f(tile, PathSlot) for every pixel of sample `sample`.
template <class Function>
void for_each_mark_slot(uint32_t width, uint32_t height, uint32_t sample, const Function& f) {
    WaveState state{};
    state.first_sample = sample;
    state.samples = 1;
    Wave wave{};
    wave.state = &state;
    wave.width = width;
    wave.height = height;
    wave.tiles_x = (width + kTileSide - 1) / kTileSide;
    wave.tiles = wave.tiles_x * ((height + kTileSide - 1) / kTileSide);
    wave.samples = 1;
    for (uint32_t slot = 0; slot < wave.slot_count(); ++slot)
        if (const PathSlot p = wave.locate(slot); p.active) f(wave, slot / kTilePixels, p);
}

/// Marks of an iteration, of its wave of the heavy tile and sample, and of the tiles and samples after that, where each
/// wave has one of each and goes through the samples of a tile first.
struct MarkCounts {
    uint32_t all, heavy_wave, after;
};
inline MarkCounts mark_counts(uint32_t width, uint32_t height, const RenderSettings& settings, uint32_t iteration) {
    const MarkPolicy policy = MarkPolicy::plan(settings);
    MarkCounts n{};
    for (uint32_t s = 0; s < policy.waves.iteration_samples; ++s)
        for_each_mark_slot(width, height, iteration * policy.waves.iteration_samples + s,
                           [&](const Wave& wave, uint32_t tile, const PathSlot& p) {
                               const uint32_t marks = policy.marks(wave, p);
                               n.all += marks;
                               if (tile == policy.heavy_tile && s == policy.heavy_sample)
                                   n.heavy_wave += marks;
                               else if (std::pair(tile, s) > std::pair(policy.heavy_tile, policy.heavy_sample))
                                   n.after += marks;
                           });
    return n;
}

/// `learns`: and splats (MarkIntegrator<..., true, true>), else neither.
inline FilmMoments mark_film(uint32_t width, uint32_t height, const RenderSettings& settings, uint32_t samples,
                             bool learns) {
    const MarkPolicy policy = MarkPolicy::plan(settings);
    const uint32_t pixels = width * height, k = policy.waves.iteration_samples;
    FilmMoments film = {width, height, samples, std::vector<double>(pixels * 3), std::vector<double>(pixels * 3)};
    std::vector<uint32_t> learned(kBins, 1);
    for (uint32_t iteration = 0; iteration < samples / k; ++iteration) {
        std::vector<std::tuple<uint32_t, uint32_t, uint32_t, float>> marks;
        for (uint32_t s = 0; s < k; ++s)
            for_each_mark_slot(width, height, iteration * k + s, [&](const Wave& wave, uint32_t, const PathSlot& p) {
                for (uint32_t depth = 0; depth < policy.marks(wave, p); ++depth) {
                    const uint32_t h = hash(p.sample * pixels + p.pixel, depth);
                    marks.emplace_back(h % kBins, s * pixels + p.pixel, depth, float(h >> 8) * 0x1p-20f);
                }
                if (learns) film.sum[size_t(hash(p.pixel, p.sample + 7) % pixels) * 3 + 2] += 1.0;
            });
        std::sort(marks.begin(), marks.end());
        std::vector<float> sums(kBins);
        std::vector<uint32_t> counts(kBins);
        for (const auto& [bin, subpath, depth, value] : marks) sums[bin] += value, ++counts[bin];
        for (uint32_t s = 0; s < k; ++s)
            for_each_mark_slot(width, height, iteration * k + s, [&](const Wave&, uint32_t, const PathSlot& p) {
                const uint32_t bin = hash(p.sample, p.pixel) % kBins;
                film.sum[size_t(p.pixel) * 3] += double(sums[bin]);
                film.sum[size_t(p.pixel) * 3 + 1] += double(learned[bin] + iteration);
            });
        for (uint32_t bin = 0; learns && bin < kBins; ++bin) learned[bin] += counts[bin];
    }
    return film;
}

}  // namespace ambilux::test
