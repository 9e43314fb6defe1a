// Small vectors in double, for what files give and floats would round.
#pragma once

#include <cmath>

#include "core/vec.h"

namespace ambilux {

struct Vec3d {
    double x, y, z;

    bool operator==(const Vec3d&) const = default;
};

inline Vec3d operator+(Vec3d a, Vec3d b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3d operator-(Vec3d a, Vec3d b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3d operator*(Vec3d a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(Vec3d a, Vec3d b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3d cross(Vec3d a, Vec3d b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double length(Vec3d a) { return std::sqrt(dot(a, a)); }
/// Not finite if `a` is zero.
inline Vec3d unit(Vec3d a) {
    const double l = length(a);
    return {a.x / l, a.y / l, a.z / l};
}
inline Vec3d in_double(Vec3f a) { return {a.x, a.y, a.z}; }
inline Vec3f rounded(Vec3d a) { return {float(a.x), float(a.y), float(a.z)}; }

}  // namespace ambilux
