// Smooth conductor: a mirror with the conductor's Fresnel reflectance, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct Conductor {
    static constexpr const char* plugin = "conductor";
    static constexpr bool smooth = false, delta = true, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color specular_reflectance;
    };
    AMBILUX_HD static constexpr void each_input(auto& p, auto visit) { visit(p.specular_reflectance); }

    struct Constants {
        Rgb eta, k;  ///< index of refraction eta - i·k, relative to the outside
    };
};

}  // namespace ambilux
