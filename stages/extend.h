// extend: rays to the next surface. A hit is completed where its ray lies: every ray becomes one, misses too. `Tracer`
// has closest<F>(scene, ray, hit) or is followed by a kernel of its own that calls fetch and finish.
#pragma once

#include "stages/order_keys.h"
#include "stages/stage.h"

namespace ambilux {

template <Features F, class Tracer, class Mis>
struct Extend {
    static constexpr const char* kName = "extend";
    static constexpr const char* kLightName = "light_extend";  ///< the record for rays of light subpaths
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;
    using Items = SubpathItems<Mis>;
    using RayItem = typename Items::Ray;

    SceneView scene;
    Tracer tracer;
    Wave wave;
    Stream stream;  ///< of the subpaths
    Queue<RayItem> rays;
    Queue<HitItem<RayItem>> hits;
    StageRecord* record;

    const Queue<RayItem>& items() const { return rays; }

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray) const {
        if (fetch(rays.load(i), ray)) return true;
        finish(i, {ray.tmax, 0.0f, 0.0f, kNone});
        return false;
    }
    /// False for an invalid ray.
    AMBILUX_HD bool fetch(const RayItem& item, Ray& ray) const {
        ray = {item.origin, Items::tmax(item), item.direction, 0};
        if constexpr (F.opacity)
            ray.alpha_seed = NumbersOf<Mis>{wave.key(item.path, stream)}.opacity_seed(item.bits.depth());
        return is_valid_ray(item.origin, item.direction, record);
    }
    /// Where the ray of an item ends.
    AMBILUX_HD HitItem<RayItem> hit_of(const RayItem& item) const {
        Ray ray;
        Hit hit = {0.0f, 0.0f, 0.0f, kNone};
        if (fetch(item, ray)) tracer.template closest<F>(scene, ray, hit);
        return {item, hit.u, hit.v, hit.prim, 0};
    }
    AMBILUX_HD void finish(uint32_t i, const Hit& hit) const {
        hits.complete(i, HitEnd{hit.u, hit.v, hit.prim, 0});
        // Otherwise nothing is sorted by material, or without keys that are kept.
        if constexpr (F.several_bsdfs())
            if (hits.keys) hits.keys[i] = uint16_t(MaterialOrder::of<F.instances>(scene, hit.prim));
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
