// Small float vectors. `Rgb` is linear Rec.709; lengths are in scene units.
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "core/hd.h"

namespace ambilux {

struct Vec2f {
    float x, y;
};

struct Vec3f {
    float x, y, z;

    AMBILUX_HD_SMALL float operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
    AMBILUX_HD_SMALL float& operator[](int i) { return i == 0 ? x : (i == 1 ? y : z); }
    AMBILUX_HD_SMALL Vec3f& operator+=(Vec3f b) {
        x += b.x;
        y += b.y;
        z += b.z;
        return *this;
    }
    AMBILUX_HD_SMALL Vec3f& operator*=(Vec3f b) {
        x *= b.x;
        y *= b.y;
        z *= b.z;
        return *this;
    }
    AMBILUX_HD_SMALL Vec3f& operator*=(float s) {
        x *= s;
        y *= s;
        z *= s;
        return *this;
    }
};

struct Vec4f {
    float x, y, z, w;
};

using Rgb = Vec3f;

AMBILUX_HD_SMALL Vec2f operator+(Vec2f a, Vec2f b) { return {a.x + b.x, a.y + b.y}; }
AMBILUX_HD_SMALL Vec2f operator-(Vec2f a, Vec2f b) { return {a.x - b.x, a.y - b.y}; }
AMBILUX_HD_SMALL Vec2f operator*(Vec2f a, float s) { return {a.x * s, a.y * s}; }
AMBILUX_HD_SMALL Vec2f operator*(float s, Vec2f a) { return a * s; }

AMBILUX_HD_SMALL Vec3f operator+(Vec3f a, Vec3f b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
AMBILUX_HD_SMALL Vec3f operator-(Vec3f a, Vec3f b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
AMBILUX_HD_SMALL Vec3f operator-(Vec3f a) { return {-a.x, -a.y, -a.z}; }
AMBILUX_HD_SMALL Vec3f operator*(Vec3f a, Vec3f b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
AMBILUX_HD_SMALL Vec3f operator*(Vec3f a, float s) { return {a.x * s, a.y * s, a.z * s}; }
AMBILUX_HD_SMALL Vec3f operator*(float s, Vec3f a) { return a * s; }
AMBILUX_HD_SMALL Vec3f operator/(Vec3f a, Vec3f b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
AMBILUX_HD_SMALL Vec3f operator/(Vec3f a, float s) { return a * (1.0f / s); }
AMBILUX_HD_SMALL bool operator==(Vec3f a, Vec3f b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

/// Rounded alike in every function, on hosts and devices: all that ask on which side of a surface a direction lies
/// agree.
AMBILUX_HD_SMALL float dot(Vec3f a, Vec3f b) { return fmaf(a.x, b.x, fmaf(a.y, b.y, a.z * b.z)); }
AMBILUX_HD_SMALL Vec3f cross(Vec3f a, Vec3f b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
AMBILUX_HD_SMALL float length_squared(Vec3f a) { return dot(a, a); }
AMBILUX_HD_SMALL float length(Vec3f a) { return sqrtf(dot(a, a)); }
/// 1 / sqrt(x), within 2 units in the last place for x > 0.
AMBILUX_HD_SMALL float inverse_sqrt(float x) {
#if defined(__CUDA_ARCH__)
    return rsqrtf(x);
#else
    return 1.0f / sqrtf(x);
#endif
}
AMBILUX_HD_SMALL Vec3f normalize(Vec3f a) { return a * inverse_sqrt(length_squared(a)); }
/// The smaller and the larger of two; of a number and a NaN the number. As fminf and fmaxf, which are one instruction
/// on a device but calls of a library on the host.
#if defined(__CUDA_ARCH__)
AMBILUX_HD_SMALL float min(float a, float b) { return fminf(a, b); }
AMBILUX_HD_SMALL float max(float a, float b) { return fmaxf(a, b); }
#else
AMBILUX_HD_SMALL float min(float a, float b) { return a < b || b != b ? a : b; }
AMBILUX_HD_SMALL float max(float a, float b) { return a > b || b != b ? a : b; }
#endif
/// Of other types, exactly: without these, numbers of 32 bits would be converted to floats, which keep 24.
template <class T>
    requires std::is_arithmetic_v<T>
AMBILUX_HD_SMALL T min(T a, T b) {
    return b < a ? b : a;
}
template <class T>
    requires std::is_arithmetic_v<T>
AMBILUX_HD_SMALL T max(T a, T b) {
    return a < b ? b : a;
}
template <class A, class B>
    requires(std::is_arithmetic_v<A> && std::is_arithmetic_v<B> && !std::is_same_v<A, B>)
void min(A, B) = delete;
template <class A, class B>
    requires(std::is_arithmetic_v<A> && std::is_arithmetic_v<B> && !std::is_same_v<A, B>)
void max(A, B) = delete;
AMBILUX_HD_SMALL float max_component(Vec3f a) { return max(a.x, max(a.y, a.z)); }
AMBILUX_HD_SMALL float min_component(Vec3f a) { return min(a.x, min(a.y, a.z)); }
AMBILUX_HD_SMALL Vec3f min(Vec3f a, Vec3f b) { return {min(a.x, b.x), min(a.y, b.y), min(a.z, b.z)}; }
AMBILUX_HD_SMALL Vec3f max(Vec3f a, Vec3f b) { return {max(a.x, b.x), max(a.y, b.y), max(a.z, b.z)}; }
AMBILUX_HD_SMALL Vec3f abs(Vec3f a) { return {fabsf(a.x), fabsf(a.y), fabsf(a.z)}; }
AMBILUX_HD_SMALL Vec3f splat(float s) { return {s, s, s}; }
AMBILUX_HD_SMALL bool is_zero(Vec3f a) { return a.x == 0.0f && a.y == 0.0f && a.z == 0.0f; }
AMBILUX_HD_SMALL bool is_finite(Vec3f a) {
    constexpr float kInf = __builtin_huge_valf();
    return (fabsf(a.x) < kInf) & (fabsf(a.y) < kInf) & (fabsf(a.z) < kInf);
}

/// Relative luminance of linear Rec.709 (ITU-R BT.709).
AMBILUX_HD_SMALL float luminance(Rgb c) { return 0.212671f * c.x + 0.715160f * c.y + 0.072169f * c.z; }

}  // namespace ambilux
