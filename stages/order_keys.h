// What items are sorted by (queues/order.h). Keys are small, since a sort takes time for every 8 bits.
#pragma once

#include <bit>

#include "core/math.h"
#include "items/subpath_items.h"
#include "queues/order.h"
#include "scene/view.h"

namespace ambilux {

/// Of hits. Materials, not types of BSDFs: equal materials read the same textures too, and there are far fewer of them
/// than warps, so that warps of mixed types are rare either way. Misses come last.
struct MaterialOrder {
    static constexpr Ordering kOrdering = Ordering::material;

    static uint32_t bits(const SceneView& scene) { return uint32_t(std::bit_width(of(scene, kNone) + 1u)); }

    template <class Ray>
    AMBILUX_HD static uint32_t key(const SceneView& scene, const HitItem<Ray>& hit) {
        return of(scene, hit.prim);
    }
    AMBILUX_HD static uint32_t key(const SceneView& scene, const SlotHit& hit) { return of(scene, hit.prim); }

    /// `Instances`: the scene may have some.
    template <bool Instances = true>
    AMBILUX_HD static uint32_t of(const SceneView& scene, uint32_t prim) {
        if constexpr (Instances)
            if (scene.instance_count && prim != kNone) prim = scene.stored(prim);
        return prim == kNone ? min(scene.material_count, kMostSortKeys) : scene.sort_keys[prim];
    }
};

/// The bits of a cell's number, at most 8 of them, two apart.
AMBILUX_HD uint32_t two_apart(uint32_t cell) {
    cell = (cell | cell << 8) & 0x0000f00fu;
    cell = (cell | cell << 4) & 0x000c30c3u;
    return (cell | cell << 2) & 0x00249249u;
}
/// Place along a Z curve of the cell that a place in units of cells lies in; cells along an axis have numbers up to
/// `last`, below 256. What is no number lands in cell 0.
AMBILUX_HD uint32_t z_curve(Vec3f at, float last) {
    const auto along = [&](float x) { return two_apart(x > 0.0f ? uint32_t(min(x, last)) : 0u); };
    return along(at.x) | along(at.y) << 1 | along(at.z) << 2;
}

/// Rays by octant of direction, then by cell of a grid of 128 cells along each axis of the scene's bounds.
struct MortonOrder {
    static constexpr Ordering kOrdering = Ordering::morton;

    static uint32_t bits(const SceneView&) { return 24; }

    template <class Item>
    AMBILUX_HD static uint32_t key(const SceneView& scene, const Item& ray) {
        const Vec3f at =
            (ray.origin - scene.bounds_center) * (64.0f / scene.bounds_radius) + Vec3f{64.0f, 64.0f, 64.0f};
        const uint32_t octant = (ray.direction.x < 0.0f ? 1u : 0u) | (ray.direction.y < 0.0f ? 2u : 0u) |
                                (ray.direction.z < 0.0f ? 4u : 0u);
        const uint32_t key = octant << 21 | z_curve(at, 127.0f);
        return key < 0xffffffu ? key : 0xfffffeu;  // the last key is that of places without a ray
    }
};

/// True for items that `Order` has keys for.
template <class Order, class Item>
concept Ordered = requires(const SceneView& scene, const Item& item) { Order::key(scene, item); };

template <class Order, class Item>
AMBILUX_HD uint32_t order_key(const SceneView& scene, const Queue<Item>& queue, uint32_t place) {
    if (std::is_same_v<Order, MaterialOrder> && queue.keys) return queue.keys[place];
    return Order::key(scene, queue.load(place));
}

}  // namespace ambilux
