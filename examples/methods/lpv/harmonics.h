// Spherical harmonics of two bands: how the intensity of a cell depends on direction (Kaplanyan and Dachsbacher 2010,
// "Cascaded Light Propagation Volumes for Real-Time Indirect Illumination"; coefficients of the clamped cosine:
// Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps").
#pragma once

#include "core/math.h"

namespace ambilux::lpv {

constexpr float kBand0 = 0.282094792f;    ///< Y_0 = 1 / (2 sqrt(pi))
constexpr float kBand1 = 0.488602512f;    ///< Y_1 = sqrt(3 / (4 pi)) times a component of the direction
constexpr float kCosine0 = 0.886226925f;  ///< of max(cos, 0): sqrt(pi) / 2
constexpr float kCosine1 = 1.02332671f;   ///< sqrt(pi / 3), along its axis

/// `T`: Rgb or float. Coefficients of Y_0 and of x, y, z in Y_1. Directions and axes are unit.
template <class T>
struct Harmonics {
    T c0, c1[3];

    AMBILUX_HD void add(T scale, const Harmonics& o) {
        c0 = c0 + o.c0 * scale;
        for (int k = 0; k < 3; ++k) c1[k] = c1[k] + o.c1[k] * scale;
    }
    /// Adds `scale` max(cos, 0) about `axis`.
    AMBILUX_HD void add_cosine(T scale, Vec3f axis) {
        c0 = c0 + scale * kCosine0;
        for (int k = 0; k < 3; ++k) c1[k] = c1[k] + scale * (kCosine1 * axis[k]);
    }
    AMBILUX_HD T at(Vec3f d) const { return c0 * kBand0 + (c1[0] * d.x + c1[1] * d.y + c1[2] * d.z) * kBand1; }
    /// Integral over all directions, times max(cos, 0) about `axis`.
    AMBILUX_HD T cosine_integral(Vec3f axis) const {
        return c0 * kCosine0 + (c1[0] * axis.x + c1[1] * axis.y + c1[2] * axis.z) * kCosine1;
    }
    /// Integral over all directions: of an intensity, the flux.
    AMBILUX_HD T flux() const { return c0 * (1.0f / kBand0); }
};

}  // namespace ambilux::lpv
