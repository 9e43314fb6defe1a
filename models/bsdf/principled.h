// The principled BSDF without transmission, front side only.
#pragma once

#include "models/bsdf/slots.h"

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

    /// What textures may set of these, too.
    template <class Number>
    struct Slots {
        Number specular_tint, sheen, sheen_tint, flatness, clearcoat;
        Number clearcoat_gloss;  ///< 0: a roughness of 0.1, 1: one of 0.001
    };
    AMBILUX_HD static Constants with_slots(Constants c, const Slots<float>& s) {
        c.specular_tint = clamp(s.specular_tint, 0.0f, 1.0f);
        c.sheen = max(s.sheen, 0.0f);
        c.clearcoat = max(s.clearcoat, 0.0f);
        c.clearcoat_alpha = 0.1f + (0.001f - 0.1f) * clamp(s.clearcoat_gloss, 0.0f, 1.0f);
        c.sheen_tint = share_of_65535(s.sheen_tint);
        c.flatness = share_of_65535(s.flatness);
        return c;
    }
};

}  // namespace ambilux
