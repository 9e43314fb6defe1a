// Where light comes from, learned: a binary tree over space, whose leaves have quadtrees over directions (Müller, Gross
// and Novák 2017, "Practical Path Guiding for Efficient Light-Transport Simulation"). Flat arrays of a fixed size.
#pragma once

#include "core/lane.h"
#include "core/sampling.h"

namespace ambilux {

/// Angle of (x, y) over 2 pi, in [0, 1]; 0 of (0, 0). Right to 2e-7: a polynomial of the lesser over the greater.
AMBILUX_HD float turn_of(float x, float y) {
    const float ax = fabsf(x), ay = fabsf(y), most = max(ax, ay);
    if (!(most > 0.0f)) return 0.0f;
    const float t = min(ax, ay) / most, s = t * t;
    float p = 0.00108401687f;
    p = p * s - 0.0053479122f;
    p = p * s + 0.0126720499f;
    p = p * s - 0.0210612528f;
    p = p * s + 0.0315250419f;
    p = p * s - 0.0530262291f;
    p = t * (p * s + 0.159154326f);
    if (ay > ax) p = 0.25f - p;
    if (x < 0.0f) p = 0.5f - p;
    return y < 0.0f ? 1.0f - p : p;
}

/// Unit directions as points of the unit square, inverse of square_to_sphere: areas are solid angles over 4 pi.
AMBILUX_HD Vec2f square_of_direction(Vec3f d) {
    return {clamp(0.5f - 0.5f * d.z, 0.0f, kOneMinusEpsilon), clamp(turn_of(d.x, d.y), 0.0f, kOneMinusEpsilon)};
}

/// Which of two parts `u` in [0,1) falls to, the first with probability `first`; `u` is uniform again after it.
AMBILUX_HD uint32_t pick_half(float first, float& u) {
    const bool second = !(u < first);
    u = second ? (u - first) / (1.0f - first) : u / first;
    u = clamp(u, 0.0f, kOneMinusEpsilon);
    return second;
}

/// A quadtree has its nodes one after the other, parents before children. A node has four quadrants, x + 2y, each of
/// which is a cell or a node in turn.
struct GuideQuads {
    static constexpr uint32_t kNodes = 128;  ///< of a quadtree, at most
    static constexpr uint32_t kLevels = 12;  ///< cells are no smaller than what rounding of a direction leaves

    Lane* masses;        ///< [leaf][node]: probabilities of the four quadrants
    uint32_t* children;  ///< [leaf][node]: node of each quadrant, a byte each; 0: a cell

    /// A cell: a quadrant of a node of the quadtree of a leaf; its side is 2^-level.
    struct Cell {
        uint32_t node, quadrant, level;
        float density;  ///< per area of the square
    };

    AMBILUX_HD static float side(uint32_t level) {
        return bits_float(FloatBits(kExponentBias - level) << kFractionBits);
    }
    AMBILUX_HD static uint32_t child(uint32_t children, uint32_t quadrant) { return children >> 8 * quadrant & 0xffu; }
    AMBILUX_HD Vec4f probabilities(uint32_t at) const { return start_of<Vec4f>(masses[at]); }
    AMBILUX_HD static float of(Vec4f m, uint32_t quadrant) {
        const float low = quadrant & 1u ? m.y : m.x, high = quadrant & 1u ? m.w : m.z;
        return quadrant & 2u ? high : low;
    }
    AMBILUX_HD Cell cell(uint32_t leaf, Vec2f u) const {
        Cell c = {0, 0, 0, 1.0f};
        for (uint32_t node = 0;;) {
            const uint32_t at = leaf * kNodes + node;
            u = {2.0f * u.x, 2.0f * u.y};
            const uint32_t x = u.x >= 1.0f, y = u.y >= 1.0f;
            u = {u.x - float(x), u.y - float(y)};
            c = {node, x + 2 * y, c.level + 1, c.density * 4.0f * of(probabilities(at), x + 2 * y)};
            node = child(children[at], c.quadrant);
            if (node == 0) return c;
        }
    }
    /// A point of the square, in proportion to the density, which is that of its cell.
    AMBILUX_HD Vec2f sample(uint32_t leaf, Vec2f u, float& density) const {
        Vec2f low = {0.0f, 0.0f};
        float side = 1.0f;
        density = 1.0f;
        for (uint32_t node = 0;;) {
            const uint32_t at = leaf * kNodes + node;
            const Vec4f m = probabilities(at);
            const float left = m.x + m.z, right = m.y + m.w;
            const uint32_t x = pick_half(left / (left + right), u.x);
            const uint32_t y = pick_half((x ? m.y : m.x) / (x ? right : left), u.y);
            side *= 0.5f;
            density *= 4.0f * of(m, x + 2 * y);
            low = {low.x + float(x) * side, low.y + float(y) * side};
            node = child(children[at], x + 2 * y);
            if (node == 0) return {low.x + side * u.x, low.y + side * u.y};
        }
    }
};

/// A leaf of the tree over space.
struct alignas(16) GuideLeaf {
    uint32_t node;     ///< of the tree over space that it is
    uint16_t depth;    ///< of that node
    uint16_t quads;    ///< nodes of its quadtree
    float bsdf_share;  ///< of directions that the BSDF samples; 1: nothing was learned here
    float reflected;   ///< mean radiance that rays scattered here bring; 0: not known
};

/// What is sampled from. Nodes of the tree over space halve their cells along x, y, z and so on.
struct GuideTree {
    static constexpr uint32_t kLeafBit = 0x80000000u;
    static constexpr uint32_t kMostDepth = 36;

    uint32_t* space;  ///< with kLeafBit a leaf, else the node of the lower half, which that of the upper one follows
    GuideLeaf* leaves;
    GuideQuads quads;
    Vec3f low;  ///< corner of the cube around the scene
    float inverse_side;

    struct Place {
        uint32_t leaf, depth;
    };

    /// In the unit cube.
    AMBILUX_HD Vec3f unit(Vec3f p) const {
        const Vec3f x = (p - low) * inverse_side;
        return {clamp(x.x, 0.0f, kOneMinusEpsilon), clamp(x.y, 0.0f, kOneMinusEpsilon),
                clamp(x.z, 0.0f, kOneMinusEpsilon)};
    }
    AMBILUX_HD Place find(Vec3f x) const {
        uint32_t node = space[0], depth = 0;
        for (; !(node & kLeafBit); ++depth) {
            const float twice = 2.0f * x.x;
            const uint32_t upper = twice >= 1.0f;
            x = {x.y, x.z, twice - float(upper)};
            node = space[node + upper];
        }
        return {node & ~kLeafBit, depth};
    }
    /// Sides of a cell of the unit cube.
    AMBILUX_HD static Vec3f sides(uint32_t depth) {
        return {GuideQuads::side((depth + 2) / 3), GuideQuads::side((depth + 1) / 3), GuideQuads::side(depth / 3)};
    }
    AMBILUX_HD uint32_t leaf(Vec3f p) const { return find(unit(p)).leaf; }
    AMBILUX_HD float pdf_sa(uint32_t leaf, Vec3f d) const {
        return kInv4Pi * quads.cell(leaf, square_of_direction(d)).density;
    }
    AMBILUX_HD Vec3f sample(uint32_t leaf, Vec2f u, float& pdf_sa) const {
        const Vec2f at = quads.sample(leaf, u, pdf_sa);
        pdf_sa *= kInv4Pi;
        return square_to_sphere(at);
    }
};

}  // namespace ambilux
