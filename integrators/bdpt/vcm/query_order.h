// The order in which eye vertices merge on a device.
#pragma once

#include "integrators/bdpt/shared/subpath_number.h"
#include "integrators/bdpt/vcm/merge_keys.h"
#include "integrators/bdpt/vcm/merging_mis.h"
#include "queues/primitives.h"
#include "queues/stage_record.h"
#include "stages/order_keys.h"

namespace ambilux {

/// Eye vertices of one depth in the order in which they merge on a device: those of a warp lie together, so that its
/// threads read the same light vertices. Below kLeast they stay as they are.
struct QueryOrder {
    static constexpr uint32_t kLeast = 1u << 15, kAxisBits = 8, kPlaceBits = 3 * kAxisBits;
    static_assert(kPlaceBits + MergeKeys::kMostIterationBits < 32);

    SortMemory<uint32_t> sort;
    const QueueCounter* queries;

    AMBILUX_HD bool sorted() const { return queries->size() >= kLeast; }
    AMBILUX_HD uint32_t at(uint32_t i) const { return sorted() ? sort.values[1][i] : i; }
    /// Iteration by iteration, in each along a Z curve through the scene's bounds.
    AMBILUX_HD static uint32_t key(const SceneView& scene, uint32_t iteration, Vec3f p) {
        constexpr float kHalf = 1u << (kAxisBits - 1);
        return iteration << kPlaceBits |
               z_curve((p - scene.bounds_center) * (kHalf / scene.bounds_radius) + splat(kHalf), 2.0f * kHalf - 1.0f);
    }
};

template <Features F, class Mis>
struct OrderQueries {
    static constexpr const char* kName = "order_queries";

    SceneView scene;
    Wave wave;
    IterationNumbers numbers;
    Queue<HitItem<typename SubpathItems<Mis>::Ray>> hits;
    QueryOrder order;
    uint32_t bits;  ///< of keys
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (!order.sorted()) return;
        const auto hit = hits.load(i);
        order.sort.keys[0][i] = hit.prim == kNone ? (1u << bits) - 1
                                                  : QueryOrder::key(scene, numbers.iteration(wave, hit.ray.path),
                                                                    surface_at<F>(scene, hit.prim, hit.u, hit.v).p);
        order.sort.values[0][i] = i;
    }
};

}  // namespace ambilux
