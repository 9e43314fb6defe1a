// What a splat counts for on the film of a pilot.
#pragma once

#include <algorithm>
#include <cmath>

#include "transport/sensor/filter.h"
#include "transport/sensor/latlong.h"

namespace ambilux {

/// Mean over places on the film of the sum of squares of what a splat counts for its pixels.
inline float filter_energy(const SceneView& scene) {
    constexpr int kSteps = 64;
    const float r = scene.sensor.filter_radius;
    double sum = 0;
    for (int y = 0; y < kSteps; ++y)
        for (int x = 0; x < kSteps; ++x) {
            const float value = filter_value(scene, {r * (2.0f * (float(x) + 0.5f) / kSteps - 1.0f),
                                                     r * (2.0f * (float(y) + 0.5f) / kSteps - 1.0f)});
            sum += double(value) * double(value);
        }
    return float(std::min(1.0, sum * 4.0 * double(r) * double(r) / (kSteps * kSteps)));
}

/// Sum of the filters of the film's pixels at a place; less than one along the edges.
inline float filter_coverage(const SceneView& scene, Vec2f film) {
    const Sensor& s = scene.sensor;
    float sum = 0.0f;
    for_each_film_position<kAllFeatures>(s, film, [&](Vec2f at) {
        const float x = at.x - float(s.crop_x), y = at.y - float(s.crop_y), r = s.filter_radius;
        if (x >= r && y >= r && x <= float(s.crop_width) - r && y <= float(s.crop_height) - r) {
            sum += 1.0f;
            return;
        }
        for (float py = max(0.0f, floorf(y - r)); py < min(y + r, float(s.crop_height)); py += 1.0f)
            for (float px = max(0.0f, floorf(x - r)); px < min(x + r, float(s.crop_width)); px += 1.0f)
                sum += filter_value(scene, {x - (px + 0.5f), y - (py + 0.5f)});
    });
    return min(sum, 1.0f);
}

/// The film in blocks of about as many pixels each.
struct FilmBlocks {
    uint32_t x = 0, y = 0;

    /// At most 32 along a side, of at least 4 pixels along each.
    static FilmBlocks of(uint32_t width, uint32_t height) {
        const auto along = [](uint32_t pixels) { return std::clamp(pixels / 4, 1u, 32u); };
        return {along(width), along(height)};
    }
    uint32_t count() const { return x * y; }
    uint32_t at(const Sensor& s, Vec2f film) const {
        const auto index = [](float position, uint32_t pixels, uint32_t blocks) {
            return uint32_t(
                std::clamp(int64_t(std::floor(double(position) * blocks / pixels)), int64_t(0), int64_t(blocks) - 1));
        };
        return index(film.y - float(s.crop_y), s.crop_height, y) * x + index(film.x - float(s.crop_x), s.crop_width, x);
    }
    /// First pixel of a column or row of blocks.
    static uint32_t edge(uint32_t block, uint32_t pixels, uint32_t blocks) {
        return uint32_t(uint64_t(block) * pixels / blocks);
    }
};

}  // namespace ambilux
