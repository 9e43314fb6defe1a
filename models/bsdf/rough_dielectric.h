// Rough dielectric boundary, both sides.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct RoughDielectric {
    static constexpr const char* plugin = "roughdielectric";
    static constexpr bool smooth = true, delta = false, transmits = true, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color specular_reflectance, specular_transmittance;
        Number alpha_u, alpha_v;  ///< roughness along s and t of the shading frame
    };

    struct Constants {
        float ior;  ///< interior over exterior index of refraction
        Microfacets distribution;
        uint16_t sample_visible;  ///< not 0: sample visible normals (Heitz and d'Eon 2014)
    };
};

}  // namespace ambilux
