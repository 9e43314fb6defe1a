#include "formats/meshes/polygons.h"

#include <algorithm>
#include <numeric>

namespace ambilux {

/// Ears: Meisters, "Polygons have ears", 1975.
bool cut_polygon(const std::vector<Vec3d>& corners, Triangles& triangles) {
    const auto area = [&](size_t a, size_t b, size_t c) {
        return cross(corners[b] - corners[a], corners[c] - corners[a]);
    };
    Vec3d normal{}, before{};
    bool concave = false;
    for (size_t k = 2; k < corners.size(); ++k) {
        const Vec3d n = area(0, k - 1, k);
        concave |= dot(n, before) < 0;
        if (dot(n, n) > 0) before = n;
        normal = normal + n;
    }
    triangles.clear();
    std::vector<uint32_t> left(concave ? corners.size() : 0);
    std::iota(left.begin(), left.end(), 0u);
    const auto side = [&](size_t a, size_t b, size_t c) { return dot(normal, area(a, b, c)); };
    constexpr size_t kMost = 1000;  // ears take the square of the corners
    for (size_t i = 1, tried = 0; corners.size() <= kMost && left.size() > 3 && tried < left.size();) {
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
    const auto corner = [&](size_t k) { return concave ? left[k] : uint32_t(k); };
    for (size_t k = 2; k < (concave ? left.size() : corners.size()); ++k)
        triangles.push_back({corner(0), corner(k - 1), corner(k)});
    return left.size() <= 3;
}

}  // namespace ambilux
