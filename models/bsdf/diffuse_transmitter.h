// Light that passes is spread evenly over the other side.
#pragma once

#include "models/bsdf/model.h"

namespace ambilux {

struct DiffuseTransmitter {
    static constexpr const char* plugin = "difftrans";
    static constexpr bool smooth = true, delta = false, transmits = true, tabulated = false;

    template <class Color, class Number>
    struct Inputs {
        Color transmittance;
    };

    struct Constants {};
};

}  // namespace ambilux
