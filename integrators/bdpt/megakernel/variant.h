// What variant megakernel of integrator bdpt has.
#pragma once

#include "integrators/offers.h"

namespace ambilux {

struct MegakernelVariant {
    static constexpr const char* kHelp = "one kernel in which subpaths live in registers, to compare with";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .sorts = false,
                                              .compacts = false,
                                              .one_kernel = true,
                                              .replay = ReplayPairing::registers,
                                              .references = References::as_it_is};

    static std::vector<SelectionOffer> selection(const SelectionRequest& r) { return paired_offers(r, ", megakernel"); }
    /// Not part of --quick: its samples are those of bdpt (tests/integrators/test_bidirectional_variants.cpp).
    static std::vector<Stressed> stress() {
        return {{"megakernel", {}, false}, {"megakernel-power", {{"heuristic", "power"}}, false}};
    }
};

}  // namespace ambilux
