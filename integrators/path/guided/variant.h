// What variant guided of integrator path has.
#pragma once

#include "integrators/path/variant.h"
#include "integrators/shared/guide/variant.h"

namespace ambilux {

struct PathGuidedVariant : GuidedVariant {
    static constexpr const char* kHelp =
        "path tracer that learns where light comes from and samples directions accordingly (path guiding, Müller et "
        "al. 2017)";
    static constexpr VariantTraits kTraits = {
        .estimators = true, .sorts = false, .compacts = false, .replay = ReplayPairing::none};

    static uint32_t strategies(const RenderSettings& s) { return PathVariant::strategies(s); }
    /// Iterations of one sample: stress renders any number of them.
    static std::vector<Stressed> stress() { return {{"path-guided", {{"guide_samples", "1"}}, false}}; }
};

}  // namespace ambilux
