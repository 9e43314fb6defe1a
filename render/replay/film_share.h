// What a splat adds to one pixel.
#pragma once

#include "film/splat_sums.h"
#include "render/replay/record.h"
#include "transport/sensor/filter.h"

namespace ambilux {

/// Value of the filter of pixel (x,y) of the crop where a splat lands; as stage splat computes it.
inline float filter_at(const SceneView& view, uint32_t x, uint32_t y, Vec2f film) {
    const float dx = film.x - float(view.sensor.crop_x), dy = film.y - float(view.sensor.crop_y);
    float weight = 0.0f;
    with_filter(view, [&](auto filter) {
        const float row = filter(dy - (float(y) + 0.5f));
        weight = row * filter(dx - (float(x) + 0.5f));
    });
    return weight;
}

/// Adds splats to the sum of a pixel, as stage splat does on the CPU.
class PixelSplats {
public:
    PixelSplats(const SceneView& view, uint32_t x, uint32_t y) : view_(view), x_(x), y_(y) {}

    bool reached(Vec2f film) const { return filter_at(view_, x_, y_, film) > 0.0f; }
    void add(ReplayCandidate& c) {
        c.filter = filter_at(view_, x_, y_, c.film);
        if (c.fate != ReplayFate::arrived) return;
        c.contribution *= c.filter;
        SplatSums{sum_, nullptr}.add(0, c.contribution, false);
    }
    const double* sum() const { return sum_; }

private:
    const SceneView& view_;
    uint32_t x_, y_;
    double sum_[3] = {};
};

}  // namespace ambilux
