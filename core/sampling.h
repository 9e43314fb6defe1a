// Warps from the unit square to disks, spheres, hemispheres, cones and triangles (PBRT 4th ed., appendix A.5).
#pragma once

#include "core/float32.h"
#include "core/math.h"

namespace ambilux {

/// Sine and cosine of x in [-pi/4, pi/4] by their series, which are below rounding after these terms: absolute error
/// 1e-7. A general sinf has to reduce its argument first. In double precision it does so: the terms are those of
/// floats.
AMBILUX_HD_SMALL void sin_cos_octant(float x, float& sine, float& cosine) {
    if constexpr (!kSinglePrecision) {
        sine = sinf(x);
        cosine = cosf(x);
        return;
    }
    const float x2 = x * x;
    sine = x + x * x2 * (-1.0f / 6 + x2 * (1.0f / 120 + x2 * (-1.0f / 5040 + x2 * (1.0f / 362880))));
    cosine = 1.0f + x2 * (-0.5f + x2 * (1.0f / 24 + x2 * (-1.0f / 720 + x2 * (1.0f / 40320))));
}

/// Sine and cosine of 2 pi t, t in [0,1]. Absolute error 1.5e-7.
AMBILUX_HD void sin_cos_turns(float t, float& sine, float& cosine) {
    const float quarter = floorf(4.0f * t + 0.5f);
    float s, c;
    sin_cos_octant(2.0f * kPi * (t - 0.25f * quarter), s, c);
    const uint32_t k = uint32_t(quarter);
    sine = k & 1u ? c : s;
    cosine = k & 1u ? s : c;
    if (k & 2u) sine = -sine;
    if ((k + 1u) & 2u) cosine = -cosine;
}

/// Uniform point of the unit disk, concentric map (Shirley and Chiu 1997). Density 1/pi per area. Absolute error 3e-7.
AMBILUX_HD_SMALL Vec2f square_to_disk(Vec2f u) {
    const float a = 2.0f * u.x - 1.0f, b = 2.0f * u.y - 1.0f;
    if (a == 0.0f && b == 0.0f) return {0.0f, 0.0f};
    const bool wide = fabsf(a) > fabsf(b);
    const float r = wide ? a : b;
    float sine, cosine;
    sin_cos_octant(kPiOver4 * ((wide ? b : a) / r), sine, cosine);
    return wide ? Vec2f{r * cosine, r * sine} : Vec2f{r * sine, r * cosine};
}

/// Cosine-weighted direction of the upper hemisphere. Density cos(theta)/pi per solid angle. Unit to 4e-7; the square
/// of its cosine is off by 8e-7 at most.
AMBILUX_HD_SMALL Vec3f square_to_cosine_hemisphere(Vec2f u) {
    const Vec2f d = square_to_disk(u);
    // Never exactly on the horizon, where the density would be zero.
    return {d.x, d.y, sqrtf(max(1.0f - d.x * d.x - d.y * d.y, 1e-14f))};
}

/// Uniform direction. Density 1/(4 pi) per solid angle. Absolute error 4e-7.
AMBILUX_HD Vec3f square_to_sphere(Vec2f u) {
    const float z = 1.0f - 2.0f * u.x, r = 2.0f * sqrtf(u.x * (1.0f - u.x));
    float sine, cosine;
    sin_cos_turns(u.y, sine, cosine);
    return {r * cosine, r * sine, z};
}

/// Uniform direction in the cone around +z. Density 1/(2 pi (1-cos_max)) per solid angle. Across the axis the error is
/// 4e-7 of the sine, down to cones of 1 - cos = 1e-30.
AMBILUX_HD Vec3f square_to_cone(Vec2f u, float one_minus_cos_max) {
    const float v = u.x * one_minus_cos_max;  // 1 - cos(theta)
    const float r = safe_sqrt(v * (2.0f - v));
    float sine, cosine;
    sin_cos_turns(u.y, sine, cosine);
    return {r * cosine, r * sine, 1.0f - v};
}

/// Uniform barycentrics (b1, b2) of a triangle, square-root map (Turk 1990). Density 1/area per area. Relative error of
/// 3 roundings; 1 - b1 - b2 >= -2^-24.
AMBILUX_HD_SMALL Vec2f square_to_triangle(Vec2f u) {
    const float s = sqrtf(u.x);
    return {s * (1.0f - u.y), s * u.y};
}

/// Index of the interval that holds `u` in a cumulative table: cdf[0] = 0 ... cdf[n] = 1, non-decreasing.
/// The result has cdf[i] <= u < cdf[i+1], so an interval of zero width is never returned for u in [0,1).
AMBILUX_HD uint32_t sample_cdf(const float32* cdf, uint32_t n, float u) {
    uint32_t lo = 0, hi = n;
    while (hi - lo > 1) {
        const uint32_t mid = (lo + hi) / 2;
        if (cdf[mid] <= u)
            lo = mid;
        else
            hi = mid;
    }
    return lo;
}

}  // namespace ambilux
