// What variant guided of integrator bdpt has.
#pragma once

#include "integrators/offers.h"
#include "integrators/shared/guide/variant.h"

namespace ambilux {

struct BdptGuidedVariant : GuidedSidesVariant {
    static constexpr const char* kHelp =
        "lvc whose subpaths sample directions from what it has learned about where light and importance come from "
        "(path guiding, Müller et al. 2017)";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .draws = true,
                                              .draws_together = true,
                                              .sorts = false,
                                              .compacts = false,
                                              .repeats = false,
                                              .replay = ReplayPairing::cache};

    /// Iterations of one sample: stress renders any number of them.
    static std::vector<Stressed> stress() {
        return {{"bdpt-guided", {{"guide_samples", "1"}, {"guide_sides", "both"}}, false}};
    }
};

}  // namespace ambilux
