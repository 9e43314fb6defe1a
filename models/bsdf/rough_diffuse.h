// Rough diffuse reflection (Oren and Nayar 1994), front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct RoughDiffuse {
    static constexpr const char* plugin = "roughdiffuse";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color reflectance;
        Number alpha;  ///< root mean square slope of the microfacets; the paper's sigma is alpha/√2 (Mitsuba's fit)
    };

    struct Constants {};
};

}  // namespace ambilux
