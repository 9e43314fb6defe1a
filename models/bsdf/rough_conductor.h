// Rough conductor: microfacet reflection, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct RoughConductor {
    static constexpr const char* plugin = "roughconductor";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color specular_reflectance;
        Number alpha_u, alpha_v;  ///< roughness along s and t of the shading frame
    };

    struct Constants {
        Rgb eta, k;  ///< index of refraction eta - i·k, relative to the outside
        Microfacets distribution;
        uint16_t sample_visible;  ///< not 0: sample visible normals (Heitz and d'Eon 2014)
    };
};

}  // namespace ambilux
