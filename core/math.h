// Scalars, frames, affine maps and the ray-origin offset.
#pragma once

#include <cstring>
#include <limits>

#include "core/vec.h"

namespace ambilux {

constexpr float kPi = 3.14159265358979323846f;
constexpr float kInvPi = 0.31830988618379067154f;
constexpr float kInv2Pi = 0.15915494309189533577f;
constexpr float kInv4Pi = 0.07957747154594766788f;
constexpr float kPiOver2 = 1.57079632679489661923f;
constexpr float kPiOver4 = 0.78539816339744830961f;
constexpr float kInfinity = __builtin_huge_valf();
/// False where this code is compiled in double precision (cmake/double_precision.cmake).
constexpr bool kSinglePrecision = sizeof(float) == 4;
/// Largest relative error of a rounded operation: 2^-24.
constexpr float kRoundingUnit = std::numeric_limits<float>::epsilon() / 2;
/// Largest float below 1.
constexpr float kOneMinusEpsilon = 1.0f - kRoundingUnit;

/// Correctly rounded on every backend. Elsewhere devices divide within 2 and take roots within 1 unit in the last place
/// (cmake/compiler.cmake).
AMBILUX_HD_SMALL float rounded_divide(float a, float b) {
#if defined(__CUDA_ARCH__)
    return __fdiv_rn(a, b);
#else
    return a / b;
#endif
}
AMBILUX_HD_SMALL float rounded_sqrt(float x) {
#if defined(__CUDA_ARCH__)
    return __fsqrt_rn(x);
#else
    return sqrtf(x);
#endif
}

AMBILUX_HD_SMALL float sqr(float x) { return x * x; }
AMBILUX_HD_SMALL float safe_sqrt(float x) { return sqrtf(max(x, 0.0f)); }
AMBILUX_HD_SMALL float clamp(float x, float lo, float hi) { return min(max(x, lo), hi); }
AMBILUX_HD_SMALL float lerp(float a, float b, float t) { return a + (b - a) * t; }
AMBILUX_HD_SMALL float degrees_to_radians(float d) { return d * (kPi / 180.0f); }

/// A float as an integer: sign, exponent and, in the lowest bits, the fraction (IEEE 754).
using FloatBits = std::conditional_t<kSinglePrecision, uint32_t, uint64_t>;
constexpr uint32_t kFractionBits = std::numeric_limits<float>::digits - 1;
constexpr FloatBits kExponentBias = std::numeric_limits<float>::max_exponent - 1;
constexpr FloatBits kInfinityBits = (2 * kExponentBias + 1) << kFractionBits;
AMBILUX_HD_SMALL FloatBits float_bits(float f) {
    FloatBits u;
    memcpy(&u, &f, sizeof f);
    return u;
}
AMBILUX_HD_SMALL float bits_float(FloatBits u) {
    float f;
    memcpy(&f, &u, sizeof f);
    return f;
}

/// Bound of the relative error after n rounded operations, n·eps/(1-n·eps) (PBRT 4th ed., 6.8.1).
constexpr float gamma_bound(int n) { return n * kRoundingUnit / (1.0f - n * kRoundingUnit); }

/// The neighbour of `v`, exactly, for all but NaN.
AMBILUX_HD_SMALL float next_float_up(float v) {
    if (v == kInfinity) return v;
    if (v == 0.0f) v = 0.0f;  // -0 to +0
    FloatBits u = float_bits(v);
    u = v >= 0.0f ? u + 1 : u - 1;
    return bits_float(u);
}
AMBILUX_HD_SMALL float next_float_down(float v) { return -next_float_up(-v); }

/// Orthonormal basis; `n` is its z axis.
struct Frame {
    Vec3f s, t, n;

    AMBILUX_HD_SMALL Vec3f to_local(Vec3f v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
    AMBILUX_HD_SMALL Vec3f to_world(Vec3f v) const { return s * v.x + t * v.y + n * v.z; }
};

/// Frame around a unit vector, without branches (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
/// Orthogonal and unit within 12 roundings (of 2^-24) and twice the error of |n|².
AMBILUX_HD_SMALL Frame frame_from_normal(Vec3f n) {
    const float sign = copysignf(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

/// Frame around unit `n` whose s axis is `dpdu` made orthogonal to it; any frame when they are parallel, by a sine
/// below 2^-10, or when lengths leave 2^-50 to 2^63. Orthogonal and unit within 16 roundings and 6 over that sine.
AMBILUX_HD_SMALL Frame frame_from_normal_tangent(Vec3f n, Vec3f dpdu) {
    const Vec3f s = dpdu - n * dot(n, dpdu);
    const float l2 = length_squared(s);
    if (!(l2 > 0x1p-20f * length_squared(dpdu) + 0x1p-100f)) return frame_from_normal(n);
    const Vec3f unit = s * inverse_sqrt(l2);
    return {unit, cross(n, unit), n};
}

/// Affine map, three rows of four. Points are columns.
struct Affine {
    float m[3][4];

    AMBILUX_HD_SMALL Vec3f point(Vec3f p) const {
        return {m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z + m[0][3],
                m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z + m[1][3],
                m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z + m[2][3]};
    }
    AMBILUX_HD_SMALL Vec3f vector(Vec3f v) const {
        return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
                m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
    }
    /// Product of the transposed linear part with `n`: call it on the inverse map to transform a normal.
    AMBILUX_HD_SMALL Vec3f transposed_vector(Vec3f n) const {
        return {m[0][0] * n.x + m[1][0] * n.y + m[2][0] * n.z, m[0][1] * n.x + m[1][1] * n.y + m[2][1] * n.z,
                m[0][2] * n.x + m[1][2] * n.y + m[2][2] * n.z};
    }
};

/// How far from `p` rays must begin along the normal `ng` of its surface: the absolute error bound `p_error` of each
/// coordinate of `p` (PBRT 4th ed., 6.8.6) and what the sum may be rounded, instead of stepping to the next float
/// afterwards.
AMBILUX_HD_SMALL float ray_offset(Vec3f p, Vec3f p_error, Vec3f ng) {
    return dot(abs(ng), p_error + abs(p) * (2.0f * kRoundingUnit));
}

/// Moves `p` off the surface with normal `ng` to the side of `w`, by `offset` (ray_offset). `ng` need not point to that
/// side. The result lies beyond every point within p_error of p, but for 2^-21 of the offset.
AMBILUX_HD_SMALL Vec3f offset_ray_origin(Vec3f p, float offset, Vec3f ng, Vec3f w) {
    return p + ng * (dot(w, ng) < 0.0f ? -offset : offset);
}
AMBILUX_HD_SMALL Vec3f offset_ray_origin(Vec3f p, Vec3f p_error, Vec3f ng, Vec3f w) {
    return offset_ray_origin(p, ray_offset(p, p_error, ng), ng, w);
}

}  // namespace ambilux
