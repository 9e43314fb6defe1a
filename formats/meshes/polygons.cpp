#include "formats/meshes/polygons.h"

#include <algorithm>
#include <numeric>

namespace ambilux {

namespace {

constexpr size_t kMost = 1000;  // corners of a polygon of which ears are looked for, which takes their square

/// Whether the triangles of the fan from the first corner face one way.
bool fan_covers(const std::vector<Vec3d>& corners) {
    Vec3d before{};
    for (size_t k = 2; k < corners.size(); ++k) {
        const Vec3d n = cross(corners[k - 1] - corners[0], corners[k] - corners[0]);
        if (dot(n, before) < 0) return false;
        if (dot(n, n) > 0) before = n;
    }
    return true;
}

}  // namespace

/// Ears: Meisters, "Polygons have ears", 1975.
void cut_polygon(const std::vector<Vec3d>& corners, Triangles& triangles) {
    triangles.clear();
    if (corners.size() > kMost || fan_covers(corners)) {
        for (uint32_t k = 2; k < corners.size(); ++k) triangles.push_back({0, k - 1, k});
        return;
    }
    Vec3d normal{};
    for (size_t k = 2; k < corners.size(); ++k)
        normal = normal + cross(corners[k - 1] - corners[0], corners[k] - corners[0]);
    const auto side = [&](uint32_t a, uint32_t b, uint32_t c) {
        return dot(normal, cross(corners[b] - corners[a], corners[c] - corners[a]));
    };
    std::vector<uint32_t> left(corners.size());
    std::iota(left.begin(), left.end(), 0u);
    for (size_t i = 1, tried = 0; left.size() > 3 && tried < left.size();) {
        const size_t n = left.size(), at = i % n;
        const uint32_t a = left[(at + n - 1) % n], b = left[at], c = left[(at + 1) % n];
        const auto is_inside = [&](uint32_t q) {
            const bool apart =
                !(corners[q] == corners[a]) && !(corners[q] == corners[b]) && !(corners[q] == corners[c]);
            return apart && side(a, b, q) >= 0 && side(b, c, q) >= 0 && side(c, a, q) >= 0;
        };
        if (!(side(a, b, c) > 0) || std::any_of(left.begin(), left.end(), is_inside)) {
            ++i, ++tried;
            continue;
        }
        triangles.push_back({a, b, c});
        left.erase(left.begin() + long(at));
        i = at, tried = 0;
    }
    for (size_t k = 2; k < left.size(); ++k) triangles.push_back({left[0], left[k - 1], left[k]});
}

}  // namespace ambilux
