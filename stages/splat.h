// mis_weight, occlude and splat of light that light subpaths bring to the film: added to the pixels whose filters reach
// it.
#pragma once

#include "film/splat_sums.h"
#include "film/strategy_film.h"
#include "stages/arrival.h"
#include "transport/sensor/filter.h"
#include "transport/sensor/latlong.h"

namespace ambilux {

/// What light vertices splat.
template <class Out>
struct WeighSplats {
    static constexpr const char* kName = "mis_weight";

    Queue<CandidateItem> candidates;
    Out weighted;
    StageRecord* record;

    const Queue<CandidateItem>& items() const { return candidates; }
    AMBILUX_HD void operator()(uint32_t i) const { push(candidates.load(i)); }

    AMBILUX_HD uint32_t push(CandidateItem c) const {
        return weighted_light(c.value, c.ratio, record, c.value) ? weighted.push(c) : 0;
    }
};

/// Shadow rays of splats.
template <Features F, class Tracer>
struct OccludeSplats {
    static constexpr const char* kName = "occlude";
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = true;
    static constexpr bool kReservesSlots = true;
    using Kept = Contribution;

    SceneView scene;
    Tracer tracer;
    Queue<CandidateItem> candidates;
    ReservedQueue<SplatItem> splats;
    StageRecord* record;

    const Queue<CandidateItem>& items() const { return candidates; }

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray, Kept& kept) const {
        const CandidateItem c = candidates.load(i);
        kept = {c.value, c.path};
        return fetch(c, ray);
    }
    AMBILUX_HD void finish(uint32_t i, const Kept& kept, bool blocked) const {
        if (blocked) return;
        const CandidateItem c = candidates.load(i);
        splats.push({kept.value, kept.path, c.film, c.strategy, c.ratio});
    }
    AMBILUX_HD void operator()(uint32_t i) const { process(candidates.load(i)); }
    AMBILUX_HD void process(const CandidateItem& c) const {
        Ray ray;
        if (fetch(c, ray) && !tracer.template occluded<F>(scene, ray))
            splats.queue.push({c.value, c.path, c.film, c.strategy, c.ratio});
    }

private:
    AMBILUX_HD bool fetch(const CandidateItem& c, Ray& ray) const {
        ray = {c.origin, c.tmax, c.direction, c.opacity_seed};
        return is_valid_ray(c.origin, c.direction, record);
    }
};

template <Features F>
struct Splat {
    static constexpr const char* kName = "splat";

    SceneView scene;
    Wave wave;
    Queue<SplatItem> splats;
    SplatSums sums;
    StrategyFilm strategies;
    StageRecord* record;

    const Queue<SplatItem>& items() const { return splats; }

    AMBILUX_HD void operator()(uint32_t i) const {
        const SplatItem item = splats.load(i);
        // Either would do for a hole; asking for both loads both lanes at once.
        if ((item.path == kNoPath) | (item.film.x != item.film.x)) return;
        for_each_film_position<F>(scene.sensor, item.film, [&](Vec2f film) { add(item, film); });
    }
    /// Asks for the cells of item `i`, one of those to come, on a host: they lie anywhere in the film.
    void prefetch(uint32_t i) const {
        const SplatItem item = splats.load(i);
        if (item.path == kNoPath || item.film.x != item.film.x) return;
        const Sensor& sensor = scene.sensor;
        const float x = clamp(item.film.x - float(sensor.crop_x) - 0.5f, 0.0f, float(wave.width - 1));
        const float y = clamp(item.film.y - float(sensor.crop_y) - 0.5f, 0.0f, float(wave.height - 1));
        const uint64_t row = uint64_t(wave.sample_of(item.path)) * wave.height + uint32_t(y);
        sums.prefetch(row * wave.width + uint32_t(x));
        sums.prefetch((row + 1) * wave.width + uint32_t(x));
    }

private:
    AMBILUX_HD void add(const SplatItem& item, Vec2f film) const {
        const Sensor& sensor = scene.sensor;
        const float x = film.x - float(sensor.crop_x), y = film.y - float(sensor.crop_y);
        const float r = sensor.filter_radius;
        const int32_t x0 = max(int32_t(ceilf(x - r - 0.5f)), 0);
        const int32_t x1 = min(int32_t(floorf(x + r - 0.5f)), int32_t(wave.width) - 1);
        const int32_t y0 = max(int32_t(ceilf(y - r - 0.5f)), 0);
        const int32_t y1 = min(int32_t(floorf(y + r - 0.5f)), int32_t(wave.height) - 1);
        const uint64_t first = uint64_t(wave.sample_of(item.path)) * wave.height * wave.width;
        // Looked for once, since it costs as much as the rest: splats of a warp that share a pixel most often share
        // all.
        const bool alone = !same_key(uint32_t(first) + uint32_t(y0) * wave.width + uint32_t(x0)).has_several_lanes();
        with_filter(scene, [&](auto filter) {
            for (int32_t py = y0; py <= y1; ++py) {
                const SplatRow locked(py);
                const float row = filter(y - (float(py) + 0.5f));
                for (int32_t px = x0; px <= x1; ++px) {
                    const float weight = row * filter(x - (float(px) + 0.5f));
                    if (!(weight > 0.0f)) continue;
                    const Rgb value = item.value * weight;
                    const uint32_t pixel = uint32_t(py) * wave.width + uint32_t(px);
                    sums.add(first + pixel, value, alone);
                    strategies.add(item.strategy, wave.width * wave.height, pixel, value * (1.0f + item.ratio), value);
                }
            }
        });
    }
};

}  // namespace ambilux
