// The principled BSDF of a sheet without thickness, both sides.
#pragma once

#include "models/bsdf/slots.h"

namespace ambilux {

struct PrincipledThin {
    static constexpr const char* plugin = "principledthin";
    static constexpr bool smooth = true, delta = false, transmits = true, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color base_color;
        Number roughness;
        Number specular;     ///< share of the specular lobes; the diffuse ones have the rest
        Number anisotropic;  ///< 0 to 1: how much longer highlights are along s than along t
    };

    struct Constants {
        float ior;            ///< inside of the sheet over outside, at least 1
        float specular_tint;  ///< share of the base colour in the reflection
        float sheen;          ///< weight of reflection at grazing angles
        float through;        ///< share of diffuse light that goes to the other side, 0 to 1
        uint16_t sheen_tint;  ///< share of the base colour in the sheen, in 1/65535
        uint16_t flatness;    ///< share of the approximation of subsurface scattering, in 1/65535
    };

    /// What textures may set of these, too.
    template <class Number>
    struct Slots {
        Number specular_tint, sheen, sheen_tint, flatness, ior, through;
    };
    AMBILUX_HD static Constants with_slots(Constants c, const Slots<float>& s) {
        c.ior = max(s.ior, 1.0f);
        c.specular_tint = clamp(s.specular_tint, 0.0f, 1.0f);
        c.sheen = max(s.sheen, 0.0f);
        c.through = clamp(s.through, 0.0f, 1.0f);
        c.sheen_tint = share_of_65535(s.sheen_tint);
        c.flatness = share_of_65535(s.flatness);
        return c;
    }
};

}  // namespace ambilux
