// What integrator path has.
#pragma once

#include "integrators/variant_traits.h"

namespace ambilux {

struct PathVariant {
    static constexpr const char* kHelp =
        "unidirectional path tracer: hits of emitters, next event estimation, or both with weights";
    static constexpr VariantTraits kTraits = {
        .estimators = true, .binary_bvh = true, .in_double = true, .finds_all_light = true};
};

}  // namespace ambilux
