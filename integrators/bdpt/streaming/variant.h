// What variant streaming of integrator bdpt has.
#pragma once

#include "integrators/offers.h"

namespace ambilux {

struct StreamingVariant {
    static constexpr const char* kHelp =
        "one ray per slot in every round; slots whose paths have ended begin new ones, so that memory is small";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .strategy_images = true,
                                              .compacts = false,
                                              .streams = true,
                                              .replay = ReplayPairing::own_vertex,
                                              .references = References::as_it_is};

    static std::vector<SelectionOffer> selection(const SelectionRequest& r) { return paired_offers(r, ", streaming"); }
    static std::vector<Stressed> stress() { return both_heuristics("streaming"); }
};

}  // namespace ambilux
