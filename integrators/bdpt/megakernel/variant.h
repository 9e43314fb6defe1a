// What variant megakernel of integrator bdpt has.
#pragma once

#include "integrators/variant_traits.h"

namespace ambilux {

struct MegakernelVariant {
    static constexpr const char* kHelp = "one kernel in which subpaths live in registers, to compare with";
    static constexpr VariantTraits kTraits = {
        .strategies = true, .light_subpaths = true, .sorts = false, .compacts = false, .finds_all_light = true};
};

}  // namespace ambilux
