// The transfer function of sRGB.
#pragma once

#include <cmath>

namespace ambilux {

/// Linear value of an encoded one (IEC 61966-2-1).
inline double srgb_to_linear(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

/// Encoded value of a linear one, clamped to [0,1].
inline float linear_to_srgb(float linear) {
    if (!(linear > 0.0f)) return 0.0f;
    if (linear >= 1.0f) return 1.0f;
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

}  // namespace ambilux
