// Diffuse reflection and a lobe about the mirror direction, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct Phong {
    static constexpr const char* plugin = "phong";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color reflectance, specular_reflectance;
        Number exponent;
    };

    struct Constants {
        float specular_sampling_weight;  ///< share of the lobe in sampling
    };
};

}  // namespace ambilux
