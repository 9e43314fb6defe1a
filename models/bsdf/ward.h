// Diffuse reflection and Ward's anisotropic lobe, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

enum class WardVariant : uint32_t { ward, duer, balanced };

struct Ward {
    static constexpr const char* plugin = "ward";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color reflectance, specular_reflectance;
        Number alpha_u, alpha_v;  ///< roughness along s and t of the shading frame
    };

    struct Constants {
        WardVariant variant;
        float specular_sampling_weight;  ///< share of the lobe in sampling
    };
};

}  // namespace ambilux
