// What variant optimal of integrator path has.
#pragma once

#include "integrators/path/optimal/settings.h"
#include "integrators/path/variant.h"
#include "integrators/setting.h"

namespace ambilux {

struct PathOptimalVariant {
    static constexpr const char* kHelp =
        "path tracer whose next events and hits have the weights of least variance at the first vertices, learned per "
        "block of pixels (optimal weights, Kondapaneni et al. 2019)";
    /// Neither the estimator nor the heuristic is a choice: weights start from those of the balance heuristic. A shadow
    /// ray that roulette drops would say nothing about the density of hits where it leads.
    static constexpr VariantTraits kTraits = {.weights = false, .culls = false, .sorts = false, .compacts = false};

    static std::vector<Declaration<OptimalSettings>> settings();
    static uint32_t strategies(const RenderSettings& s) { return PathVariant::strategies(s); }
    /// Iterations of one sample: stress renders any number of them.
    static std::vector<Stressed> stress() { return {{"path-optimal", {{"optimal_samples", "1"}}, false}}; }
};

}  // namespace ambilux
