// What integrator path has.
#pragma once

#include "integrators/offers.h"

namespace ambilux {

struct PathVariant {
    static constexpr const char* kHelp =
        "unidirectional path tracer: hits of emitters, next event estimation, or both with weights";
    static constexpr VariantTraits kTraits = {.estimators = true,
                                              .binary_bvh = true,
                                              .light_tree = true,
                                              .sobol = true,
                                              .in_double = true,
                                              .replay = ReplayPairing::none,
                                              .references = References::plain};

    static uint32_t strategies(const RenderSettings& s) {
        return s.estimator == Estimator::naive ? uint32_t(kHitStrategies) : kHitStrategies | kNextEventStrategies;
    }
    static std::vector<SelectionOffer> selection(const SelectionRequest& r) {
        if (r.light_paths != 0.0f) return {};
        return {{"", {{"estimator", "mis"}}}};
    }
    static std::vector<Stressed> stress() {
        return {{"path-naive", {{"estimator", "naive"}}},
                {"path-nee", {{"estimator", "nee"}}},
                {"path-mis"},
                {"path-mis-power", {{"heuristic", "power"}}}};
    }
};

}  // namespace ambilux
