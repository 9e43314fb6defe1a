// The order in which eye vertices merge on a device.
#pragma once

#include "integrators/bdpt/vcm/merging_mis.h"
#include "items/subpath_items.h"
#include "queues/primitives.h"
#include "queues/queue.h"
#include "queues/stage_record.h"

namespace ambilux {

/// Eye vertices of one depth in the order in which they merge on a device: those of a warp lie together, so that its
/// threads read the same light vertices. Below kLeast they stay as they are.
struct QueryOrder {
    static constexpr uint32_t kLeast = 1u << 15, kAxisBits = 8, kBits = 3 * kAxisBits;

    SortMemory<uint32_t> sort;
    const QueueCounter* queries;

    AMBILUX_HD bool sorted() const { return queries->size() >= kLeast; }
    AMBILUX_HD uint32_t at(uint32_t i) const { return sorted() ? sort.values[1][i] : i; }
    /// Along a Z curve through the scene's bounds.
    AMBILUX_HD static uint32_t key(const SceneView& scene, Vec3f p) {
        constexpr float kHalf = 1u << (kAxisBits - 1);
        const Vec3f c = (p - scene.bounds_center) * (kHalf / scene.bounds_radius) + splat(kHalf);
        return spread(c.x) | spread(c.y) << 1 | spread(c.z) << 2;
    }

private:
    /// The bits of a coordinate's cell, two apart.
    AMBILUX_HD static uint32_t spread(float x) {
        uint32_t cell = uint32_t(min(max(x, 0.0f), float((1u << kAxisBits) - 1)));
        cell = (cell | cell << 8) & 0x0000f00fu;
        cell = (cell | cell << 4) & 0x000c30c3u;
        return (cell | cell << 2) & 0x00249249u;
    }
};

template <Features F>
struct OrderQueries {
    static constexpr const char* kName = "order_queries";

    SceneView scene;
    Queue<HitItem<SubpathItems<MergingMis>::Ray>> hits;
    QueryOrder order;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (!order.sorted()) return;
        const auto hit = hits.load(i);
        const uint32_t none = (1u << QueryOrder::kBits) - 1;
        order.sort.keys[0][i] =
            hit.prim == kNone ? none : QueryOrder::key(scene, surface_at<F>(scene, hit.prim, hit.u, hit.v).p);
        order.sort.values[0][i] = i;
    }
};

}  // namespace ambilux
