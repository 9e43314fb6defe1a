// The last walks of a wave. Few of them cost as much as many, since every launch lasts as long as its slowest ray: so
// they go on for several depths in one launch.
#pragma once

#include "stages/stage.h"

namespace ambilux {

/// Depths of one launch. Whatever a stage pushes once per hit it may push as often per walk.
constexpr uint32_t kTailDepths = 16;

/// Fewer walks than this do not fill a device (docs/performance.md).
constexpr uint32_t kTailWalks = 1u << 15;

/// shade and extend in turns, from hits to the rays that are left after kTailDepths. Rays and hits between them count
/// as items of their stages, the time as shade's.
template <class Shade, class Extend>
struct Tail {
    Shade shade;
    Extend extend;

    /// Walks `first`, first + stride, ... of `count` in this launch.
    AMBILUX_HD void run(uint32_t first, uint32_t count, uint32_t stride) const {
        auto hit = decltype(shade.hit(0)){};
        uint32_t left = 0;  // depths that the walk in hand may go on for
        for (uint32_t i = first;;) {
            if (left == 0) {
                if (i >= count) return;
                hit = shade.hit(i);
                i += stride;
                left = kTailDepths;
            }
            auto ray = decltype(shade.rays.load(0)){};
            if (!shade.take(hit, ray)) {
                left = 0;
            } else if (--left == 0) {
                shade.rays.push(ray);
            } else {
                hit = extend.hit_of(ray);
                extend.record->count_item(ray.bits.depth());
                shade.record->count_item(ray.bits.depth());
            }
        }
    }
};

}  // namespace ambilux
