// occlude: light whose way is free becomes a contribution.
#pragma once

#include "items/path_items.h"
#include "stages/mis_weight.h"
#include "stages/stage.h"
#include "transport/emitter.h"

namespace ambilux {

/// `Tracer` has occluded<F>(scene, ray) or is followed by a kernel of its own that calls fetch and finish, and keeps in
/// between what fetch leaves for finish: lanes of a warp end one by one, and all would wait for what each of them
/// loads.
template <Features F, class Tracer>
struct Occlude {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = true;
    using Kept = Contribution;

    SceneView scene;
    Tracer tracer;
    Queue<ShadowItem> shadows;
    ArrivalOutlet contributions;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray, Kept& kept) const {
        const ShadowItem item = shadows.load(i);
        kept = {item.value, item.path};
#if defined(__CUDA_ARCH__)
        // The sample that light would be added to. In kernels for environments this costs more than it brings
        // (docs/performance.md).
        if (!F.has_environment() && contributions.through)
            asm volatile("prefetch.global.L2 [%0];" ::"l"(contributions.next.samples + item.path));
#endif
        return fetch(item, ray);
    }
    /// False for a ray that is none.
    AMBILUX_HD bool fetch(const ShadowItem& item, Ray& ray) const {
        ray = {item.o, fabsf(item.tmax), item.d, item.alpha_seed};
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        return false;
    }

    AMBILUX_HD void finish([[maybe_unused]] uint32_t i, Kept kept, bool blocked) const {
        if (blocked) return;
        if constexpr (F.has_environment())
            arrive(kept, shadows.load(i));
        else
            contributions.push(kept);
    }
    /// True if nothing is in the way of an item that is in no queue.
    AMBILUX_HD bool is_free(const ShadowItem& item) const {
        Ray ray;
        return fetch(item, ray) && !tracer.template occluded<F>(scene, ray);
    }
    /// All of it for such an item.
    AMBILUX_HD void take(const ShadowItem& item) const {
        if (is_free(item)) arrive({item.value, item.path}, item);
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        Ray ray;
        Kept kept;
        if (fetch(i, ray, kept)) finish(i, kept, tracer.template occluded<F>(scene, ray));
    }

private:
    AMBILUX_HD void arrive(Kept kept, const ShadowItem& item) const {
        if constexpr (F.has_environment()) {
            if (item.tmax == kTowardsEnvironment) {
                const Rgb radiance = environment_radiance<F>(scene, item.d);
                contributions.next.techniques.scale(kept.path, radiance);
                kept.value *= radiance;
                if (!is_light(kept.value, record)) return;
            }
        }
        contributions.push(kept);
    }
};

}  // namespace ambilux
