// What the leaves of a fast tree stand for: boxes of primitives, or of parts of large triangles, and their codes along
// Morton's curve.
#pragma once

#include "accel/cwbvh_node.h"
#include "accel/split_bounds.h"
#include "scene/primitive_bounds.h"

namespace ambilux::fast {

/// A primitive, or a part of one, in its box.
struct Reference {
    Bounds3f bounds;
    uint32_t prim;
};

/// A cube over all references. Cells are cubes too, so that the planes between them are those of Morton codes.
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

/// The coarsest plane between cells that a box meets.
struct GridPlane {
    int axis = 0;
    int level = -1;  ///< cells on its level are 2^level of the finest wide; -1: no plane
    float position;
};

AMBILUX_HD GridPlane coarsest_plane(const Grid& grid, const Bounds3f& b) {
    GridPlane plane;
    float widest = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        const uint32_t last = cell_of(grid, b.upper, axis), apart = cell_of(grid, b.lower, axis) ^ last;
        if (apart == 0) continue;
        const int level = detail::highest_bit(apart);
        const float width = b.upper[axis] - b.lower[axis];
        if (level < plane.level || (level == plane.level && width <= widest)) continue;
        plane = {axis, level, grid.corner[axis] + rounded_divide(float(last >> level << level), grid.cells)};
        widest = width;
    }
    return plane;
}

AMBILUX_HD float cube_root(float x) {
    if (!(x > 1e-30f)) return 0.0f;
    float y = bits_float(float_bits(x) / 3 + 709921077u);
    for (int i = 0; i < 3; ++i) y = (2.0f * y + rounded_divide(x, y * y)) * (1.0f / 3.0f);
    return y;
}

/// Splits that triangles are worth, in no unit: by what the box is larger than those of ever smaller parts would be,
/// and by how large nodes are that it stands across (Karras and Aila 2013, "Fast Parallel Construction of High-Quality
/// Bounding Volume Hierarchies", section 4.3). 0 of others; -1: has no box.
struct WeighSplits {
    SceneView scene;
    const Bounds3f* all;
    float* worth;

    AMBILUX_HD void operator()(uint32_t i) const {
        const Bounds3f b = finite_bounds(scene, i);
        worth[i] = b.empty() ? -1.0f : scene.is_triangle(i) ? of_triangle(scene.triangles[i], b) : 0.0f;
    }

private:
    AMBILUX_HD float of_triangle(const Triangle& t, const Bounds3f& b) const {
        const Vec3f v0 = scene.vertices[t.v0].p, n = abs(cross(scene.vertices[t.v1].p - v0, scene.vertices[t.v2].p - v0));
        const float waste = b.half_area() - (n.x + n.y + n.z), whole = all->half_area();
        const GridPlane plane = coarsest_plane(grid_over(*all), b);
        if (plane.level < 0 || !(waste > 0.0f) || !(whole > 0.0f)) return 0.0f;
        return cube_root(rounded_divide(waste, whole) * rounded_divide(float(1u << plane.level), float(1u << kGridBits)));
    }
};

/// Parts of a triangle beside the first.
constexpr uint32_t kMostSplits = 31;

/// counts[i]: references of primitive i; that of `primitives` is 0, so that sums end with all.
struct CountReferences {
    const float* worth;
    float splits;  ///< times its worth: of a triangle
    uint32_t primitives;
    uint32_t* counts;

    AMBILUX_HD void operator()(uint32_t i) const {
        const float w = i < primitives ? worth[i] : -1.0f;
        counts[i] = w < 0.0f ? 0 : 1 + uint32_t(min(w * splits, float(kMostSplits)));
    }
};

/// References of primitive i, from first[i] on: one, or as many parts of it as there is room for, the larger ones split
/// more often.
struct MakeReferences {
    SceneView scene;
    const Bounds3f* all;
    const uint32_t* first;
    Reference* references;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t begin = first[i], end = first[i + 1];
        if (begin == end) return;
        const Grid grid = grid_over(*all);
        // What is still to be split has, for a while, how often in the place of its primitive.
        references[begin] = {finite_bounds(scene, i), end - begin - 1};
        for (uint32_t k = begin; k < end; ++k) {
            while (const uint32_t splits = references[k].prim) {
                Bounds3f left, right;
                split(grid, i, references[k].bounds, left, right);
                const uint32_t share = left_share(left, right, splits - 1);
                references[k] = {left, share};
                references[k + 1 + share] = {right, splits - 1 - share};
            }
            references[k].prim = i;
        }
    }

private:
    AMBILUX_HD void split(const Grid& grid, uint32_t prim, const Bounds3f& b, Bounds3f& left, Bounds3f& right) const {
        GridPlane plane = coarsest_plane(grid, b);
        if (plane.level < 0 || !(plane.position > b.lower[plane.axis] && plane.position < b.upper[plane.axis])) {
            const Vec3f e = b.upper - b.lower;
            plane.axis = e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2;
            plane.position = b.lower[plane.axis] * 0.5f + b.upper[plane.axis] * 0.5f;
        }
        split_triangle_bounds(scene, prim, b, plane.axis, plane.position, left, right);
    }
    AMBILUX_HD static float longest(const Bounds3f& b) { return max_component(b.upper - b.lower); }
    AMBILUX_HD static uint32_t left_share(const Bounds3f& left, const Bounds3f& right, uint32_t splits) {
        const float l = longest(left), both = l + longest(right);
        return both > 0.0f ? min(splits, uint32_t(float(splits) * rounded_divide(l, both) + 0.5f)) : splits / 2;
    }
};

/// Boxes of all primitives of a scene.
struct PrimitiveBoxes {
    SceneView scene;
    AMBILUX_HD Bounds3f operator[](uint32_t i) const { return finite_bounds(scene, i); }
};

/// Joins those of `in` whose number is i modulo `parts`. `In`: boxes by number.
template <class In>
struct JoinBounds {
    In in;
    uint32_t count, parts;
    Bounds3f* out;

    AMBILUX_HD void operator()(uint32_t i) const {
        Bounds3f all;
        for (uint32_t k = i; k < count; k += parts) all.extend(in[k]);
        out[i] = all;
    }
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
