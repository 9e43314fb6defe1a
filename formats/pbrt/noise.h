// Perlin's noise and sums of it, as pbrt-v4 has them.
#pragma once

#include "core/vec3d.h"

namespace ambilux::pbrt {

/// Improved noise (Perlin 2002), between -1 and 1.
double noise(double x, double y, double z);

/// Frequency of an octave over that of the one before: no whole number, so that lattices do not meet.
inline constexpr double kLacunarity = 1.99;

/// Fractional Brownian motion: octaves of noise, each of `omega` times the amplitude of the one before (PBRT 4th ed.,
/// 10.6). All octaves count: there is no pixel that some would be too fine for.
double fbm(Vec3d p, double omega, int octaves);
/// The same of absolute values.
double turbulence(Vec3d p, double omega, int octaves);

}  // namespace ambilux::pbrt
