// Light that arrives anywhere on the film: weighted, tested for occlusion, added up in fixed point, so that the sum
// does not depend on the order of threads.
#pragma once

#include "film/splat_sums.h"
#include "items/walk_items.h"
#include "queues/wave.h"
#include "stages/bidirectional_policy.h"
#include "stages/outlet.h"
#include "stages/stage.h"
#include "transport/sensor/filter.h"

namespace ambilux {

struct WeightSplats {
    Queue<SplatCandidate> candidates;
    HostOutlet<SplatCandidate> weighted;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const { take(candidates.load(i)); }

    AMBILUX_HD uint32_t take(SplatCandidate c) const {
        c.value *= 1.0f / (1.0f + c.others);
        return is_light(c.value, record) && !is_zero(c.value) ? weighted.push(c) : 0;
    }
};

using SplatOutlet = Outlet<SplatCandidate, WeightSplats>;

template <Features F, class Tracer>
struct OccludeSplats {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = true;
    static constexpr bool kPushesLoosely = true;
    using Kept = Contribution;

    SceneView scene;
    Tracer tracer;
    Queue<SplatCandidate> candidates;
    Queue<SplatItem> splats;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray, Kept& kept) const {
        const SplatCandidate c = candidates.load(i);
        kept = {c.value, c.path};
        return fetch(c, ray);
    }
    /// False for a ray that is none.
    AMBILUX_HD bool fetch(const SplatCandidate& c, Ray& ray) const {
        ray = {c.o, c.tmax, c.d, c.alpha_seed};
        if (is_finite(c.o) && is_finite(c.d)) return true;
        count_one(&record->nan);
        return false;
    }
    AMBILUX_HD void finish(uint32_t i, const Kept& kept, bool blocked) const {
        if (blocked) return;
        const SplatCandidate c = candidates.load(i);
        splats.push_loosely({kept.value, kept.path, c.film, c.strategy, c.others});
    }
    /// All of it for a candidate that is in no queue.
    AMBILUX_HD void take(const SplatCandidate& c) const {
        Ray ray;
        if (fetch(c, ray) && !tracer.template occluded<F>(scene, ray))
            splats.push({c.value, c.path, c.film, c.strategy, c.others});
    }
    AMBILUX_HD void operator()(uint32_t i) const {
        Ray ray;
        Kept kept;
        if (fetch(i, ray, kept)) finish(i, kept, tracer.template occluded<F>(scene, ray));
    }
};

/// Adds light to the pixels whose filters reach it.
struct Splat {
    SceneView scene;
    Wave wave;
    Queue<SplatItem> splats;
    SplatSums sums;
    TechniqueFilm techniques;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const SplatItem item = splats.load(i);
        if ((item.path == kNoPath) | (item.film.x != item.film.x))
            return;  // either would do for a hole; asking for both loads both lanes at once
        const uint32_t sample = wave.sample_of(item.path);
        const float x = item.film.x - float(scene.sensor.crop_x), y = item.film.y - float(scene.sensor.crop_y),
                    r = scene.sensor.filter_radius;
        const int32_t x0 = max(int32_t(ceilf(x - r - 0.5f)), 0),
                      x1 = min(int32_t(floorf(x + r - 0.5f)), int32_t(wave.width) - 1);
        const int32_t y0 = max(int32_t(ceilf(y - r - 0.5f)), 0),
                      y1 = min(int32_t(floorf(y + r - 0.5f)), int32_t(wave.height) - 1);
        const uint64_t first = uint64_t(sample) * wave.height * wave.width;
        // Looked for once, since it costs as much as the rest: splats of a warp that share a pixel most often share
        // all.
        const bool alone = !several(threads_with(uint32_t(first) + uint32_t(y0) * wave.width + uint32_t(x0)));
        with_filter(scene, [&](auto filter) {
            for (int32_t py = y0; py <= y1; ++py) {
                const float row = filter(y - (float(py) + 0.5f));
                for (int32_t px = x0; px <= x1; ++px) {
                    const float weight = row * filter(x - (float(px) + 0.5f));
                    if (!(weight > 0.0f)) continue;
                    const Rgb value = item.value * weight;
                    const uint32_t pixel = uint32_t(py) * wave.width + uint32_t(px);
                    if (!sums.add(first + pixel, value, alone)) count_one(&record->inf);
                    techniques.add(wave, item.strategy, pixel, value * (1.0f + item.others), value);
                }
            }
        });
    }
};

/// Adds the samples of the film's pixels, what eye walks and what light walks brought, to the sums of the film; empties
/// the sums of splats.
struct DevelopSplats {
    Wave wave;
    const Lane* samples;  ///< by slot
    SplatSums splats;
    double *sum, *sum_squares;
    StageRecord* record;

    /// `i` is a slot of the first sample.
    AMBILUX_HD void operator()(uint32_t i) const {
        const PathSlot p = wave.locate(i);
        if (!p.active) return;
        const uint64_t at = uint64_t(p.pixel) * 3;
        double s[3] = {sum[at], sum[at + 1], sum[at + 2]},
               q[3] = {sum_squares[at], sum_squares[at + 1], sum_squares[at + 2]};
        const uint32_t stride = wave.tiles * kTilePixels, count = wave.state->samples;
        constexpr uint32_t kTogether = 4;  // loads that do not wait for each other
        for (uint32_t first = 0; first < count; first += kTogether) {
            Rgb eye[kTogether];
            double value[kTogether][3];
            const auto each = [&](auto f) {
                for (uint32_t k = 0; k < kTogether; ++k)
                    if (first + k < count) f(k, uint64_t(first + k) * wave.height * wave.width + p.pixel);
            };
            each([&](uint32_t k, uint64_t cell) {
                eye[k] = start_of<Rgb>(samples[i + (first + k) * stride]);
                splats.read(cell, value[k]);
            });
            each([&](uint32_t k, uint64_t cell) {
                splats.clear(cell);
                for (int c = 0; c < 3; ++c) value[k][c] += double(eye[k][c]);
                if (!is_light({float(value[k][0]), float(value[k][1]), float(value[k][2])}, record)) return;
                for (int c = 0; c < 3; ++c) {
                    s[c] += value[k][c];
                    q[c] += value[k][c] * value[k][c];
                }
            });
        }
        for (uint32_t c = 0; c < 3; ++c) {
            sum[at + c] = s[c];
            sum_squares[at + c] = q[c];
        }
    }
};

}  // namespace ambilux
