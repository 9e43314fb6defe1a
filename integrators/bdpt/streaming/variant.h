// What variant streaming of integrator bdpt has.
#pragma once

#include "integrators/variant_traits.h"

namespace ambilux {

struct StreamingVariant {
    static constexpr const char* kHelp =
        "one ray per slot in every round; slots whose paths have ended begin new ones, so that memory is small";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .strategy_images = true,
                                              .compacts = false,
                                              .streams = true,
                                              .finds_all_light = true};
};

}  // namespace ambilux
