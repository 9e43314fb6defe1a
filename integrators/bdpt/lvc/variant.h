// What variant lvc of integrator bdpt has.
#pragma once

#include "integrators/variant_traits.h"

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
                                              .finds_all_light = true};
};

}  // namespace ambilux
