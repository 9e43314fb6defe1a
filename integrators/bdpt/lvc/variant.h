// What variant lvc of integrator bdpt has.
#pragma once

#include "integrators/offers.h"

namespace ambilux {

struct LvcVariant {
    static constexpr const char* kHelp =
        "eye vertices draw from a cache of the light vertices of all light subpaths of a wave";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .draws = true,
                                              .draws_together = true,
                                              .strategy_images = true,
                                              .repeats = false,
                                              .light_tree = true,
                                              .sobol = true,
                                              .replay = ReplayPairing::cache,
                                              .references = References::as_it_is};

    static std::vector<SelectionOffer> selection(const SelectionRequest& r) {
        std::vector<SelectionOffer> offers;
        for (uint32_t k = 1; r.light_paths != 0.0f && r.may_draw() && k <= 16; k *= 2)
            offers.push_back({", lvc, " + std::to_string(k) + (k > 1 ? " connections" : " connection"),
                              {{"strategies", "all"}, {"connections", std::to_string(k)}},
                              true,
                              k,
                              k});
        return offers;
    }
    static std::vector<Stressed> stress() { return both_heuristics("lvc"); }
};

}  // namespace ambilux
