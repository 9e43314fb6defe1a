// Smooth dielectric boundary: Fresnel reflection and refraction, both sides.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct Dielectric {
    static constexpr const char* plugin = "dielectric";
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
