// The principled BSDF without transmission, front side only.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct Principled {
    static constexpr const char* plugin = "principled";
    static constexpr bool smooth = true, delta = false, transmits = false, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color base_color;
        Number roughness, metallic;
        Number anisotropic;  ///< 0 to 1: how much longer highlights are along s than along t
    };

    struct Constants {
        float ior;              ///< interior over exterior index of refraction, at least 1
        float specular_tint;    ///< share of the base colour in the dielectric reflection
        float sheen;            ///< weight of reflection at grazing angles
        float clearcoat;        ///< weight of the coating
        float clearcoat_alpha;  ///< its roughness
        uint16_t sheen_tint;    ///< share of the base colour in it, in 1/65535
        uint16_t flatness;      ///< share of the approximation of subsurface scattering, in 1/65535
    };
};

}  // namespace ambilux
