// What integrator bdpt has where every eye subpath is connected with the light subpath of its slot, and integrator
// light, which is bdpt without all but its strategies t = 1.
#pragma once

#include "integrators/variant_traits.h"

namespace ambilux {

struct WavefrontVariant {
    static constexpr const char* kHelp =
        "bidirectional path tracer: every eye subpath is connected with a light subpath of its own";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .strategy_images = true,
                                              .in_double = true,
                                              .finds_all_light = true};
};

struct LightVariant {
    static constexpr const char* kHelp = "light tracer: vertices of light subpaths are connected with the camera";
    static constexpr VariantTraits kTraits = {.light_subpaths = true, .strategy_images = true, .in_double = true};
};

}  // namespace ambilux
