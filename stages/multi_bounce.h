// The last subpaths of a wave on a device. Few of them cost as much as many, since every launch lasts as long as its
// slowest ray: so they go on for several bounces in one launch.
#pragma once

#include "queues/stage_record.h"

namespace ambilux {

/// Bounces of one launch. Whatever a stage pushes once per hit it may push as often per subpath.
constexpr uint32_t kBouncesPerLaunch = 16;

/// Fewer subpaths than this do not fill a device (docs/performance.md).
constexpr uint32_t kMultiBounceBelow = 1u << 15;

/// A vertex stage and extend in turns, from hits to the rays that are left after kBouncesPerLaunch. Rays and hits
/// between them count as items of their stages, the time as that of the vertex stage.
template <class VertexStage, class Extend>
struct MultiBounce {
    static constexpr const char* kName = VertexStage::kName;

    VertexStage vertex;
    Extend extend;
    StageRecord* record;

    const auto& items() const { return vertex.items(); }

    /// Subpaths `first`, first + stride, ... of `count` in this launch.
    AMBILUX_HD void run(uint32_t first, uint32_t count, uint32_t stride) const {
        auto hit = decltype(vertex.hit(0)){};
        uint32_t left = 0;  // bounces that the subpath in hand may go on for
        for (uint32_t i = first;;) {
            if (left == 0) {
                if (i >= count) return;
                hit = vertex.hit(i);
                i += stride;
                left = kBouncesPerLaunch;
            }
            auto ray = decltype(vertex.rays.load(0)){};
            if (!vertex.step(hit, ray)) {
                left = 0;
            } else if (--left == 0) {
                vertex.rays.push(ray);
            } else {
                hit = extend.hit_of(ray);
                extend.record->count_item(ray.bits.depth());
                vertex.record->count_item(ray.bits.depth());
            }
        }
    }
};

}  // namespace ambilux
