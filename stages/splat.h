// splat: light is added to the pixels whose filters reach it.
#pragma once

#include "film/splat_sums.h"
#include "film/strategy_film.h"
#include "stages/stage.h"
#include "transport/sensor/filter.h"
#include "transport/sensor/latlong.h"

namespace ambilux {

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
