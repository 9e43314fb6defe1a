// extend: rays to the next surface.
#pragma once

#include "scene/accel/traceable.h"
#include "stages/path_items.h"
#include "stages/stage.h"
#include "stages/wave.h"

namespace ambilux {

/// The ray of an item, without the seed for surfaces of partial opacity.
AMBILUX_HD Ray ray_of(const RayItem& r) { return {r.o, r.bits.depth() == 1 ? r.pdf_sa : kInfinity, r.d, 0}; }

AMBILUX_HD HitItem hit_of(const RayItem& r, const Hit& hit) { return {r.o, r.path, r.d, r.bits, r.throughput, r.pdf_sa, hit.u, hit.v, hit.prim, 0}; }

/// `Tracer` has closest<F>(scene, ray, hit) or is followed by a kernel of its own that calls fetch and finish. `Out` is what hit_of makes of an `Item`.
template <Features F, class Tracer, class Item = RayItem, class Out = HitItem>
struct Extend {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;

    SceneView scene;
    Tracer tracer;
    Wave wave;
    Stream stream;      ///< of the walks
    bool keep_escapes;  ///< rays that end nowhere are wanted: there is an environment, and it counts
    Queue<Item> rays;
    Queue<Out> hits;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray) const {
        const Item item = rays.load(i);
        ray = ray_of(item);
        if constexpr (F.opacity) ray.alpha_seed = alpha_seed(wave.key(item.path, stream), item.bits.depth(), false);
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        return false;
    }

    AMBILUX_HD void finish(uint32_t i, const Hit& hit) const {
        if (hit.prim == kNone && (!F.has_environment() || !keep_escapes)) return;
        hits.push(hit_of(rays.load(i), hit));
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
