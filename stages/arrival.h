// mis_weight, occlude, accumulate: what becomes of light that a vertex found. It is weighted against the other
// strategies that could have found it, its way is tested, and it is added to the sample of its path. `Out` takes what
// is left: a queue, or the stage that follows. A device traces in a kernel of its own that calls fetch and finish, and
// keeps in between what fetch leaves for finish: lanes of a warp end one by one, and all would wait for what each of
// them loads.
#pragma once

#include "film/strategy_film.h"
#include "stages/ray_packets.h"
#include "stages/stage.h"
#include "transport/emitter.h"
#include "transport/mis/heuristic.h"
#include "transport/subpath/roulette.h"

namespace ambilux {

/// Light `value`, not zero, of a strategy times its weight. False if that is nothing, or no radiance; light below the
/// range of floats is counted, but not where the weight says that other strategies have it.
AMBILUX_HD bool weighted_light(Rgb value, float ratio, StageRecord* record, Rgb& weighted) {
    weighted = value * mis_weight(ratio);
    if (!is_valid_radiance(weighted, record)) return false;
    if (!is_zero(weighted)) return true;
    if (ratio <= 0x1p24f) add_count(&record->underflow, 1);
    return false;
}

/// Emission that eye subpaths met.
template <class Out>
struct WeighEmission {
    static constexpr const char* kName = "mis_weight";

    Queue<EmissionItem> candidates;
    Out contributions;
    StageRecord* record;
    StrategyFilm strategies;

    const Queue<EmissionItem>& items() const { return candidates; }
    AMBILUX_HD void operator()(uint32_t i) const { push(candidates.load(i)); }

    AMBILUX_HD uint32_t push(const EmissionItem& c) const {
        Rgb value;
        if (!weighted_light(c.value, c.ratio, record, value)) return 0;
        strategies.remember(c.path, c.value, c.strategy);
        return contributions.push(Contribution{value, c.path});
    }
};

/// What eye vertices found by next event estimation and by connections.
/// `Item`: CandidateItem, or one with a note for `Out`.
template <class Out, class Item = CandidateItem>
struct WeighCandidates {
    static constexpr const char* kName = "mis_weight";

    Queue<Item> candidates;
    Out shadows;
    StageRecord* record;
    StrategyFilm strategies;
    const Lane* samples;  ///< what the paths have brought so far
    float cull;           ///< cull_factor; 0: none

    const Queue<Item>& items() const { return candidates; }
    AMBILUX_HD void operator()(uint32_t i) const { push(candidates.load(i)); }

    template <class Given>
    AMBILUX_HD uint32_t push(const Given& candidate) const {
        typename Out::value_type item;
        return weigh(candidate, item) ? shadows.push(item) : 0;
    }
    /// False if nothing is left to be tested.
    template <class Given, class Shadow>
    AMBILUX_HD bool weigh(const Given& candidate, Shadow& item) const {
        const CandidateItem& c = plain(candidate);
        Rgb value;
        if (!weighted_light(c.value, c.ratio, record, value)) return false;
        if (cull > 0.0f && c.tmax != kTowardsEnvironment) {
            const float factor = cull_factor(cull, value, start_of<Rgb>(samples[c.path]), c.opacity_seed);
            if (factor == 0.0f) return false;
            value *= factor;
        }
        strategies.remember(c.path, c.value, c.strategy);
        make_shadow(candidate, value, item);
        return true;
    }
};

/// A queue of shadow rays that are traced whenever there are `most` of them, on a host; what is left when the stage
/// that makes them ends is traced by a launch.
template <class Stage>
struct Gathered {
    using value_type = typename std::remove_cvref_t<decltype(std::declval<Stage>().items())>::value_type;

    Stage stage;
    const WaveState* state;
    uint32_t most;

    template <class Item>
    uint32_t push(const Item& item) const {
        const auto& queue = stage.items();
        queue.push(item);
        if (queue.counter->count >= most) trace();
        return 0;
    }

private:
    __attribute__((noinline)) void trace() const {
        const auto& queue = stage.items();
        const uint32_t count = queue.counter->size();
        const FusedClock clock(stage.record, most < kMostPacketRays);
        RayPackets<Stage> packets(stage);
        for (uint32_t i = 0; i < count; ++i) packets.add(i);
        packets.trace();
        queue.counter->finish();
        stage.record->count_items(count, state->depth);
    }
};

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

/// accumulate. As a rule one launch holds at most one contribution per path, so that no two threads meet and the sum
/// does not depend on the order of the queue; launches with several say so by `needs_atomic_add`.
struct Accumulate {
    static constexpr const char* kName = "accumulate";

    Queue<Contribution> contributions;
    Lane* samples;
    StageRecord* record;
    Wave wave;
    StrategyFilm strategies;
    bool needs_atomic_add = false;

    const Queue<Contribution>& items() const { return contributions; }
    AMBILUX_HD void operator()(uint32_t i) const { push(contributions.load(i)); }

    AMBILUX_HD uint32_t push(const Contribution& c) const {
        if (add(c) && strategies.sums)
            strategies.arrive(c.path, wave.width * wave.height, wave.locate(c.path).pixel, c.value);
        return 0;
    }
    /// To the sample alone.
    AMBILUX_HD bool add(const Contribution& c) const {
        if (!is_valid_radiance(c.value, record)) return false;
        if (needs_atomic_add)
            add_rgb(reinterpret_cast<float*>(samples + c.path), c.value);
        else
            set_start(samples[c.path], start_of<Rgb>(samples[c.path]) + c.value);
        return true;
    }
};

}  // namespace ambilux
