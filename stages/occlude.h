// occlude: light whose way is free arrives. A device traces in a kernel of its own that calls fetch and finish, and
// keeps in between what fetch leaves for finish: lanes of a warp end one by one, and all would wait for what each of
// them loads.
#pragma once

#include "stages/accumulate.h"
#include "transport/emitter.h"

namespace ambilux {

/// Nothing is learned from shadow rays.
struct LearnNothing {
    using Item = ShadowItem;
    using Candidate = CandidateItem;

    AMBILUX_HD static const ShadowItem& ray(const ShadowItem& item) { return item; }
    AMBILUX_HD void arrive(const ShadowItem&) const {}
};

/// Shadow rays of eye vertices. `Out` takes contributions, `Learn` sees those that are free.
template <Features F, class Tracer, class Out, class Learn = LearnNothing>
struct Occlude {
    using Item = typename Learn::Item;
    static constexpr bool kLearns = !std::is_same_v<Learn, LearnNothing>;

    static constexpr const char* kName = "occlude";
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = true;
    using Kept = Contribution;

    SceneView scene;
    Tracer tracer;
    Queue<Item> shadows;
    Out contributions;
    StageRecord* record;
    StrategyFilm strategies;
    [[no_unique_address]] Learn learn = {};

    const Queue<Item>& items() const { return shadows; }

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray, Kept& kept) const {
        const Item whole = shadows.load(i);
        const ShadowItem& item = Learn::ray(whole);
        kept = {item.value, item.path};
        // The sample that light would be added to. In kernels for environments this costs more than it brings.
        if constexpr (!F.has_environment() && requires { contributions.samples; })
            prefetch_line(contributions.samples + item.path);
        return fetch(item, ray);
    }
    AMBILUX_HD void finish([[maybe_unused]] uint32_t i, Kept kept, bool blocked) const {
        if (blocked) return;
        if constexpr (F.has_environment() || kLearns)
            arrive(kept, shadows.load(i));
        else
            contributions.push(kept);
    }
    AMBILUX_HD void operator()(uint32_t i) const { process(shadows.load(i)); }
    AMBILUX_HD void process(const Item& whole) const {
        const ShadowItem& item = Learn::ray(whole);
        if (is_free(item)) arrive({item.value, item.path}, whole);
    }
    AMBILUX_HD bool is_free(const ShadowItem& item) const {
        Ray ray;
        return fetch(item, ray) && !tracer.template occluded<F>(scene, ray);
    }
    /// The same stage for launches with several shadow rays of a path.
    AMBILUX_HD Occlude with_atomic_add(bool on) const {
        Occlude stage = *this;
        if constexpr (requires { stage.contributions.needs_atomic_add; }) stage.contributions.needs_atomic_add = on;
        return stage;
    }

private:
    /// False for a ray that is invalid.
    AMBILUX_HD bool fetch(const ShadowItem& item, Ray& ray) const {
        ray = {item.origin, fabsf(item.tmax), item.direction, item.opacity_seed};
        return is_valid_ray(item.origin, item.direction, record);
    }
    AMBILUX_HD void arrive(Kept kept, const Item& whole) const {
        [[maybe_unused]] const ShadowItem& item = Learn::ray(whole);
        learn.arrive(whole);
        if constexpr (F.has_environment()) {
            if (item.tmax == kTowardsEnvironment) {
                const Rgb radiance = environment_radiance<F>(scene, item.direction);
                strategies.scale(kept.path, radiance);
                kept.value *= radiance;
                if (!is_valid_radiance(kept.value, record)) return;
            }
        }
        contributions.push(kept);
    }
};

/// Shadow rays of splats.
template <Features F, class Tracer>
struct OccludeSplats {
    static constexpr const char* kName = "occlude";
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = true;
    static constexpr bool kReservesSlots = true;
    using Kept = Contribution;

    SceneView scene;
    Tracer tracer;
    Queue<CandidateItem> candidates;
    ReservedQueue<SplatItem> splats;
    StageRecord* record;

    const Queue<CandidateItem>& items() const { return candidates; }

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray, Kept& kept) const {
        const CandidateItem c = candidates.load(i);
        kept = {c.value, c.path};
        return fetch(c, ray);
    }
    AMBILUX_HD void finish(uint32_t i, const Kept& kept, bool blocked) const {
        if (blocked) return;
        const CandidateItem c = candidates.load(i);
        splats.push({kept.value, kept.path, c.film, c.strategy, c.ratio});
    }
    AMBILUX_HD void operator()(uint32_t i) const { process(candidates.load(i)); }
    AMBILUX_HD void process(const CandidateItem& c) const {
        Ray ray;
        if (fetch(c, ray) && !tracer.template occluded<F>(scene, ray))
            splats.queue.push({c.value, c.path, c.film, c.strategy, c.ratio});
    }

private:
    AMBILUX_HD bool fetch(const CandidateItem& c, Ray& ray) const {
        ray = {c.origin, c.tmax, c.direction, c.opacity_seed};
        return is_valid_ray(c.origin, c.direction, record);
    }
};

}  // namespace ambilux
