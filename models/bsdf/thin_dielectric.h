// Thin dielectric plate: both boundaries at once, no displacement or bending.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct ThinDielectric {
    static constexpr const char* plugin = "thindielectric";
    static constexpr bool smooth = false, delta = true, transmits = true, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color specular_reflectance, specular_transmittance;
    };

    struct Constants {
        float ior;  ///< interior over exterior index of refraction
    };
};

}  // namespace ambilux
