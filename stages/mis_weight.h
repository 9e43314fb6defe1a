// mis_weight: light is weighted against the other strategy that could have found it.
#pragma once

#include "items/path_items.h"
#include "stages/accumulate.h"
#include "stages/outlet.h"
#include "stages/path_policy.h"
#include "stages/stage.h"
#include "transport/mis.h"

namespace ambilux {

AMBILUX_HD float mis_weight(const PathPolicy& policy, float pdf_this, float pdf_other) {
    if (policy.estimator != Estimator::mis) return 1.0f;
    return policy.heuristic == MisHeuristic::power ? power_weight(pdf_this, pdf_other)
                                                   : balance_weight(pdf_this, pdf_other);
}

using ArrivalOutlet = Outlet<Contribution, Accumulate>;

/// Light that rays met.
struct WeightHits {
    PathPolicy policy;
    Queue<HitCandidate> candidates;
    ArrivalOutlet contributions;
    StageRecord* record;
    TechniqueFilm techniques = {};

    AMBILUX_HD void operator()(uint32_t i) const { take(candidates.load(i)); }

    AMBILUX_HD uint32_t take(const HitCandidate& c) const {
        const Rgb value = c.value * mis_weight(policy, c.pdf_this, c.pdf_other);
        if (!is_light(value, record) || is_zero(value)) return 0;
        techniques.remember(c.path, c.value, c.strategy);
        return contributions.push({value, c.path});
    }
};

/// Russian roulette before the shadow ray. What would add less than a share `cull` of the light that its path has
/// brought so far survives with the probability of its part of that share, and is worth more by the inverse: the
/// expectation stays, since the light so far and `seed` are known before. Returns the factor, 0 for what is dropped.
AMBILUX_HD float survival_factor(float cull, Rgb value, Rgb so_far, uint32_t seed) {
    const float probability = luminance(value) / (cull * luminance(so_far));
    if (!(probability < 1.0f)) return 1.0f;
    return hash_float(seed, 0x63756c6cu) < probability ? 1.0f / probability : 0.0f;
}

/// Light that was sampled at emitters, or found by connecting vertices.
struct WeightConnections {
    PathPolicy policy;
    Queue<ConnectCandidate> candidates;
    HostOutlet<ShadowItem> shadows;
    StageRecord* record;
    TechniqueFilm techniques = {};
    const Lane* samples = nullptr;  ///< what the paths have brought so far

    AMBILUX_HD void operator()(uint32_t i) const { take(candidates.load(i)); }

    AMBILUX_HD uint32_t take(const ConnectCandidate& c) const {
        ShadowItem item;
        return weigh(c, item) ? shadows.push(item) : 0;
    }
    /// False if nothing is left to be tested.
    AMBILUX_HD bool weigh(const ConnectCandidate& c, ShadowItem& item) const {
        Rgb value = c.value * mis_weight(policy, c.pdf_this, c.pdf_other);
        if (!is_light(value, record) || is_zero(value)) return false;
        if (policy.cull > 0.0f && c.tmax != kTowardsEnvironment) {
            const float factor = survival_factor(policy.cull, value, start_of<Rgb>(samples[c.path]), c.alpha_seed);
            if (factor == 0.0f) return false;
            value *= factor;
        }
        techniques.remember(c.path, c.value, c.strategy);
        item = {value, c.path, c.o, c.tmax, c.d, c.alpha_seed};
        return true;
    }
};

using HitOutlet = Outlet<HitCandidate, WeightHits>;
using ConnectOutlet = Outlet<ConnectCandidate, WeightConnections>;

}  // namespace ambilux
