// The transfer function of sRGB.
#pragma once

#include <cmath>

namespace ambilux {

/// Linear value of an encoded one (IEC 61966-2-1).
inline double srgb_to_linear(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

}  // namespace ambilux
