// mis_weight: light is weighted against the other strategy that could have found it.
#pragma once

#include "stages/path_items.h"
#include "stages/path_policy.h"
#include "stages/stage.h"
#include "transport/mis.h"

namespace ambilux {

AMBILUX_HD float mis_weight(const PathPolicy& policy, float pdf_this, float pdf_other) {
    if (policy.estimator != Estimator::mis) return 1.0f;
    return policy.heuristic == MisHeuristic::power ? power_weight(pdf_this, pdf_other) : balance_weight(pdf_this, pdf_other);
}

/// Light that rays met.
struct WeightHits {
    PathPolicy policy;
    Queue<HitCandidate> candidates;
    Queue<Contribution> contributions;
    StageRecord* record;
    TechniqueFilm techniques = {};

    AMBILUX_HD void operator()(uint32_t i) const {
        const HitCandidate c = candidates.load(i);
        const Rgb value = c.value * mis_weight(policy, c.pdf_this, c.pdf_other);
        if (!is_light(value, record) || is_zero(value)) return;
        techniques.remember(c.path, c.value, c.strategy);
        contributions.push({value, c.path});
    }
};

/// Light that was sampled at emitters.
struct WeightConnections {
    PathPolicy policy;
    Queue<ConnectCandidate> candidates;
    Queue<ShadowItem> shadows;
    StageRecord* record;
    TechniqueFilm techniques = {};

    AMBILUX_HD void operator()(uint32_t i) const {
        const ConnectCandidate c = candidates.load(i);
        const Rgb value = c.value * mis_weight(policy, c.pdf_this, c.pdf_other);
        if (!is_light(value, record) || is_zero(value)) return;
        techniques.remember(c.path, c.value, c.strategy);
        shadows.push({value, c.path, c.o, c.tmax, c.d, c.alpha_seed});
    }
};

}  // namespace ambilux
