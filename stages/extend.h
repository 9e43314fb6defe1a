// extend: rays to the next surface.
#pragma once

#include "scene/accel/traceable.h"
#include "stages/path_items.h"
#include "stages/stage.h"
#include "stages/wave.h"

namespace ambilux {

/// `Tracer` has closest<F>(scene, ray, hit) or is followed by a kernel of its own that calls fetch and finish.
template <Features F, class Tracer>
struct Extend {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;

    SceneView scene;
    Tracer tracer;
    Wave wave;
    Queue<RayItem> rays;
    Queue<HitItem> hits;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray) const {
        const RayItem item = rays.load(i);
        ray = {item.o, item.bits.depth() == 1 ? item.pdf_sa : kInfinity, item.d, 0};
        if constexpr (F.opacity) ray.alpha_seed = alpha_seed(wave.key(item.path), item.bits.depth(), false);
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        return false;
    }

    AMBILUX_HD void finish(uint32_t i, const Hit& hit) const {
        // Without an environment a ray that ends nowhere brings nothing.
        if (hit.prim == kNone && (!F.has_environment() || scene.environment == kNone)) return;
        const RayItem r = rays.load(i);
        hits.push({r.o, r.path, r.d, r.bits, r.throughput, r.pdf_sa, hit.u, hit.v, hit.prim, 0});
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
