// What the leaves of a fast tree stand for: boxes of primitives, and their codes along Morton's curve.
#pragma once

#include "scene/primitive_bounds.h"

namespace ambilux::fast {

/// A primitive in its box.
struct Reference {
    Bounds3f bounds;
    uint32_t prim;
};

/// A cube over all references.
struct Grid {
    Vec3f corner;
    float cells;  ///< per unit of length, of the finest level
};
constexpr int kGridBits = 21;

AMBILUX_HD Grid grid_over(const Bounds3f& b) {
    if (b.empty()) return {{0, 0, 0}, 0.0f};
    const Vec3f e = b.upper - b.lower;
    const float extent = max(max(e.x, max(e.y, e.z)), 0x1p-100f);
    return {b.lower, rounded_divide(float(1 << kGridBits), extent)};
}

AMBILUX_HD uint32_t cell_of(const Grid& grid, Vec3f p, int axis) {
    const float cell = (p[axis] - grid.corner[axis]) * grid.cells;
    constexpr uint32_t kLast = (1u << kGridBits) - 1;
    return cell >= float(kLast) ? kLast : cell > 0.0f ? uint32_t(cell) : 0u;
}

/// Bits of x at every third place.
AMBILUX_HD uint64_t spread(uint32_t x) {
    uint64_t b = x & 0x1fffffu;
    b = (b | b << 32) & 0x1f00000000ffffull;
    b = (b | b << 16) & 0x1f0000ff0000ffull;
    b = (b | b << 8) & 0x100f00f00f00f00full;
    b = (b | b << 4) & 0x10c30c30c30c30c3ull;
    return (b | b << 2) & 0x1249249249249249ull;
}

AMBILUX_HD uint64_t morton_code(const Grid& grid, const Bounds3f& b) {
    const Vec3f centre = b.lower * 0.5f + b.upper * 0.5f;
    return spread(cell_of(grid, centre, 0)) << 2 | spread(cell_of(grid, centre, 1)) << 1 |
           spread(cell_of(grid, centre, 2));
}

/// counts[i]: 1 if primitive i has a box; that of `primitives` is 0, so that sums end with all.
struct CountReferences {
    SceneView scene;
    uint32_t primitives;
    uint32_t* counts;

    AMBILUX_HD void operator()(uint32_t i) const {
        counts[i] = i < primitives && !finite_bounds(scene, i).empty() ? 1 : 0;
    }
};

/// The reference of primitive i at first[i], if it has one.
struct MakeReferences {
    SceneView scene;
    const uint32_t* first;
    Reference* references;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (first[i + 1] > first[i]) references[first[i]] = {finite_bounds(scene, i), i};
    }
};

/// Joins the boxes of those of `in` whose number is i modulo `parts`.
template <class In>
struct JoinBounds {
    const In* in;
    uint32_t count, parts;
    Bounds3f* out;

    AMBILUX_HD void operator()(uint32_t i) const {
        Bounds3f all;
        for (uint32_t k = i; k < count; k += parts) all.extend(box(in[k]));
        out[i] = all;
    }

private:
    AMBILUX_HD static const Bounds3f& box(const Reference& r) { return r.bounds; }
    AMBILUX_HD static const Bounds3f& box(const Bounds3f& b) { return b; }
};

struct MakeCodes {
    const Reference* references;
    const Bounds3f* all;
    uint64_t* codes;
    uint32_t* numbers;

    AMBILUX_HD void operator()(uint32_t i) const {
        codes[i] = morton_code(grid_over(*all), references[i].bounds);
        numbers[i] = i;
    }
};

}  // namespace ambilux::fast
