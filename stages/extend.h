// extend: rays to the next surface.
#pragma once

#include "accel/traceable.h"
#include "items/path_items.h"
#include "queues/wave.h"
#include "stages/order_keys.h"
#include "stages/stage.h"

namespace ambilux {

/// The ray of an item, without the seed for surfaces of partial opacity.
AMBILUX_HD Ray ray_of(const RayItem& r) { return {r.o, r.bits.depth() == 1 ? r.pdf_sa : kInfinity, r.d, 0}; }

/// A hit is completed where its ray lies: every ray becomes one, also those that meet nothing. `Tracer` has
/// closest<F>(scene, ray, hit) or is followed by a kernel of its own that calls fetch and finish. An `Out` is an `Item`
/// and a HitEnd.
template <Features F, class Tracer, class Item = RayItem, class Out = HitItem>
struct Extend {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;
    static_assert(sizeof(Out) == sizeof(Item) + sizeof(HitEnd));

    SceneView scene;
    Tracer tracer;
    Wave wave;
    Stream stream;  ///< of the walks
    Queue<Item> rays;
    Queue<Out> hits;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray) const {
        if (fetch(rays.load(i), ray)) return true;
        finish(i, {ray.tmax, 0.0f, 0.0f, kNone});
        return false;
    }

    /// False for a ray that is none.
    AMBILUX_HD bool fetch(const Item& item, Ray& ray) const {
        ray = ray_of(item);
        if constexpr (F.opacity) ray.alpha_seed = alpha_seed(wave.key(item.path, stream), item.bits.depth(), false);
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        return false;
    }

    /// Where the ray of an item ends.
    AMBILUX_HD Out hit_of(const Item& item) const {
        Ray ray;
        Hit hit = {0.0f, 0.0f, 0.0f, kNone};
        if (fetch(item, ray)) tracer.template closest<F>(scene, ray, hit);
        return ambilux::hit_of(item, hit);
    }

    AMBILUX_HD void finish(uint32_t i, const Hit& hit) const {
        hits.complete(i, HitEnd{hit.u, hit.v, hit.prim, 0});
        if constexpr (F.several_bsdfs())  // otherwise nothing is sorted by material, or without keys that are kept
            if (hits.keys) hits.keys[i] = uint16_t(MaterialOrder::of(scene, hit.prim));
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        Ray ray;
        if (!fetch(i, ray)) return;
        Hit hit;
        tracer.template closest<F>(scene, ray, hit);
        finish(i, hit);
    }
};

}  // namespace ambilux
