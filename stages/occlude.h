// occlude: light whose way is free becomes a contribution.
#pragma once

#include "stages/mis_weight.h"
#include "stages/path_items.h"
#include "stages/stage.h"
#include "transport/emitter.h"

namespace ambilux {

/// `Tracer` has occluded<F>(scene, ray) or is followed by a kernel of its own that calls fetch and finish.
template <Features F, class Tracer>
struct Occlude {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = true;

    SceneView scene;
    Tracer tracer;
    Queue<ShadowItem> shadows;
    ArrivalOutlet contributions;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray) const {
        const ShadowItem item = shadows.load(i);
        ray = {item.o, fabsf(item.tmax), item.d, item.alpha_seed};
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        return false;
    }

    AMBILUX_HD void finish(uint32_t i, bool blocked) const {
        if (blocked) return;
        const ShadowItem item = shadows.load(i);
        Rgb value = item.value;
        if constexpr (F.has_environment()) {
            if (item.tmax == kTowardsEnvironment) {
                value *= environment_radiance<F>(scene, item.d);
                if (!is_light(value, record)) return;
            }
        }
        contributions.push({value, item.path});
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        Ray ray;
        if (fetch(i, ray)) finish(i, tracer.template occluded<F>(scene, ray));
    }
};

}  // namespace ambilux
