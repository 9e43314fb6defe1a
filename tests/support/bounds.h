// Adversarial numbers, and arithmetic wide enough to judge floats, for tests of error bounds. A bound is a number of
// roundings times kUnit.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/math.h"

namespace ambilux::bounds {

/// Relative error of one rounding to the nearest float.
constexpr double kUnit = 0x1p-24;

/// 113 bits: differences of floats whose exponents are less than 20 apart, and products of two of those, are exact.
using Exact = __float128;

inline Exact abs(Exact x) { return x < 0 ? -x : x; }

struct Exact3 {
    Exact x, y, z;

    Exact3(Exact a, Exact b, Exact c) : x(a), y(b), z(c) {}
    Exact3(Vec3f v) : x(v.x), y(v.y), z(v.z) {}
    Exact operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
    Exact3 operator+(Exact3 b) const { return {x + b.x, y + b.y, z + b.z}; }
    Exact3 operator-(Exact3 b) const { return {x - b.x, y - b.y, z - b.z}; }
    Exact3 operator*(Exact s) const { return {x * s, y * s, z * s}; }
};
inline Exact dot(Exact3 a, Exact3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Exact3 cross(Exact3 a, Exact3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Exact3 abs(Exact3 a) { return {abs(a.x), abs(a.y), abs(a.z)}; }
inline double norm(Exact3 a) { return double(std::sqrt(static_cast<long double>(dot(a, a)))); }

/// The largest quotient of an error and its bound that a test has seen.
struct Worst {
    double share = 0;
    void add(double error, double bound) {
        const double s = error == 0 ? 0 : error / bound;
        if (!(s <= share)) share = s;  // a NaN stays
    }
};

/// Each component rounded once.
inline Vec3f unit_of(Vec3f v) {
    const double l = std::sqrt(double(v.x) * v.x + double(v.y) * v.y + double(v.z) * v.z);
    return {float(v.x / l), float(v.y / l), float(v.z / l)};
}

/// Seeded numbers.
struct Numbers {
    std::mt19937 rng;

    explicit Numbers(uint32_t seed) : rng(seed) {}
    /// Multiples of 2^-24 in [0,1), as core/rng.h has them.
    float uniform() { return float(rng() >> 8) * 0x1p-24f; }
    bool chance(float p) { return uniform() < p; }
    uint32_t index(uint32_t n) { return uint32_t(rng() % n); }
    /// A power of ten between 10^lo and 10^hi with a random mantissa; either sign if `both`.
    float magnitude(float lo, float hi, bool both = false) {
        const float m = std::pow(10.0f, lo + (hi - lo) * uniform()) * (1.0f + 0.5f * uniform());
        return both && chance(0.5f) ? -m : m;
    }
    Vec3f vector(float lo, float hi) {
        return {magnitude(lo, hi, true), magnitude(lo, hi, true), magnitude(lo, hi, true)};
    }
    /// A unit vector within rounding: anywhere, or with components of zero or down to 10^least.
    Vec3f unit(float least = -44) {
        Vec3f v = {2 * uniform() - 1, 2 * uniform() - 1, 2 * uniform() - 1};
        if (chance(0.5f))
            for (int i = 0; i < 3; ++i)
                if (chance(0.5f)) v[i] = chance(0.3f) ? std::copysign(0.0f, v[i]) : magnitude(least, 0, true);
        return is_zero(v) ? Vec3f{0, 0, chance(0.5f) ? 1.0f : -1.0f} : unit_of(v);
    }
};

/// Unit vectors at the poles and on all axes, either sign of zero, their neighbours, the diagonals.
inline std::vector<Vec3f> corner_directions() {
    std::vector<Vec3f> all;
    for (int axis = 0; axis < 3; ++axis)
        for (const float sign : {1.0f, -1.0f})
            for (const float a : {0.0f, -0.0f, 1e-45f, -1e-38f, 1e-30f, 1e-12f, -1e-7f, 3e-4f})
                for (const float b : {0.0f, -0.0f, 1e-20f, -1e-4f}) {
                    Vec3f v;
                    v[axis] = sign;
                    v[(axis + 1) % 3] = a;
                    v[(axis + 2) % 3] = b;
                    all.push_back(v);
                    v[axis] = sign * kOneMinusEpsilon;
                    all.push_back(v);
                }
    for (const float x : {-1.0f, 1.0f})
        for (const float y : {-1.0f, 1.0f})
            for (const float z : {-1.0f, 0.0f, 1.0f}) all.push_back(normalize(Vec3f{x, y, z}));
    return all;
}

/// Numbers of [0,1) at and next to what maps of the unit square treat apart.
inline std::vector<float> corner_numbers() {
    std::vector<float> all = {0.0f, 0x1p-24f, 0x1p-23f, 1e-4f, kOneMinusEpsilon, 1 - 0x1p-23f, 0x1.fffff8p-1f};
    for (const float x : {0.125f, 0.25f, 0.375f, 0.5f, 0.625f, 0.75f, 0.875f})
        all.insert(all.end(), {x - 0x1p-24f, x, x + 0x1p-24f});
    return all;
}

}  // namespace ambilux::bounds
