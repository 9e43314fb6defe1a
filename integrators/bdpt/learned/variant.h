// What variant learned of integrator bdpt has.
#pragma once

#include <vector>

#include "integrators/bdpt/learned/settings.h"
#include "integrators/offers.h"
#include "integrators/setting.h"

namespace ambilux {

struct LearnedVariant {
    static constexpr const char* kHelp =
        "lvc whose draws follow what light vertices have brought to eye vertices in earlier iterations";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .draws = true,
                                              .repeats = false,
                                              .references = References::as_it_is};

    static std::vector<Declaration<LearnedSettings>> settings();
    /// Uniform draws that four learned ones are taken to be worth, and for how much more work than four uniform ones,
    /// from as many eye subpaths on as teach enough: what ten scenes show on a CPU
    /// (docs/lab/2026-11-25-learned-draws.md) and twenty-two on a device (docs/lab/2026-11-28-regret.md).
    static std::vector<SelectionOffer> selection(const SelectionRequest& r) {
        const bool images = r.settings.technique_depth > 0;  // of strategies, which it does not gather
        const bool offered = r.asked.selects_any || r.itself;
        if (r.light_paths == 0.0f || !offered || !r.may_draw() || images) return {};
        const uint32_t worth = r.cuda ? 16 : 12;
        const double work = r.cuda ? 1.75 : 1.25;
        return {
            {", learned, 4 connections", {{"strategies", "all"}, {"connections", "4"}}, true, 4, worth, work, 1 << 18}};
    }
    /// Random scenes compare it with the others instead (docs/validation.md).
    static std::vector<Stressed> stress() { return {}; }
};

}  // namespace ambilux
