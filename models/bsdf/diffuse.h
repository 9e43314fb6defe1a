// Lambertian reflection from the front side.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct Diffuse {
    static constexpr const char* plugin = "diffuse";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color reflectance;
    };
    AMBILUX_HD static constexpr void each_input(auto& p, auto visit) { visit(p.reflectance); }

    struct Constants {};
};

}  // namespace ambilux
