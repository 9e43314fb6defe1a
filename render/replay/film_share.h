// What a splat adds to one pixel.
#pragma once

#include "film/splat_sums.h"
#include "render/replay/context.h"
#include "render/replay/record.h"
#include "transport/sensor/filter.h"
#include "transport/sensor/latlong.h"

namespace ambilux {

/// Value of the filter of pixel (x,y) of the crop at a place; as stage splat computes it.
inline float filter_at(const SceneView& view, uint32_t x, uint32_t y, Vec2f place) {
    const float dx = place.x - float(view.sensor.crop_x), dy = place.y - float(view.sensor.crop_y);
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

    bool reached(Vec2f film) const {
        bool reached = false;
        each_weight(film, [&](float) { reached = true; });
        return reached;
    }
    void add(ReplayCandidate& c) {
        const bool arrived = c.fate == ReplayFate::arrived;
        c.filter = 0.0f;
        each_weight(c.film, [&](float weight) {
            c.filter += weight;
            if (arrived) SplatSums{sum_, nullptr}.add(0, c.contribution * weight, false);
        });
        if (arrived) c.contribution *= c.filter;
    }
    const double* sum() const { return sum_; }

private:
    /// op(weight) for each place where the pixel's filter meets what is seen at `film`.
    template <class Op>
    void each_weight(Vec2f film, Op op) const {
        for_each_film_position<kReplayFeatures>(view_.sensor, film, [&](Vec2f place) {
            const float weight = filter_at(view_, x_, y_, place);
            if (weight > 0.0f) op(weight);
        });
    }

    const SceneView& view_;
    uint32_t x_, y_;
    double sum_[3] = {};
};

}  // namespace ambilux
