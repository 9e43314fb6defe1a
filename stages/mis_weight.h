// mis_weight: light is weighted against the other strategies that could have found it. `Out` takes what is left: a
// queue, or the stage that follows.
#pragma once

#include "film/strategy_film.h"
#include "stages/stage.h"
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

/// What light vertices splat.
template <class Out>
struct WeighSplats {
    static constexpr const char* kName = "mis_weight";

    Queue<CandidateItem> candidates;
    Out weighted;
    StageRecord* record;

    const Queue<CandidateItem>& items() const { return candidates; }
    AMBILUX_HD void operator()(uint32_t i) const { push(candidates.load(i)); }

    AMBILUX_HD uint32_t push(CandidateItem c) const {
        return weighted_light(c.value, c.ratio, record, c.value) ? weighted.push(c) : 0;
    }
};

}  // namespace ambilux
