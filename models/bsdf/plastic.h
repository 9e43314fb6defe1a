// Smooth plastic: a dielectric coating over a diffuse base with internal scattering, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct Plastic {
    static constexpr const char* plugin = "plastic";
    static constexpr bool smooth = true, delta = true, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color reflectance, specular_reflectance;
    };

    struct Constants {
        float ior;                       ///< interior over exterior index of refraction
        float fdr_internal;              ///< mean diffuse Fresnel reflectance seen from inside
        float specular_sampling_weight;  ///< share of the specular lobe in sampling, before Fresnel
        uint32_t nonlinear;              ///< not 0: colour shifts by internal scattering
    };
};

}  // namespace ambilux
