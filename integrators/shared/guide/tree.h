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

/// A quadtree has its nodes one after the other, parents before children. A node has four quadrants, x + 2y, each of
/// which is a cell or a node in turn.
struct GuideQuads {
    static constexpr uint32_t kNodes = 128;  ///< of a quadtree, at most
    static constexpr uint32_t kLevels = 12;  ///< cells are no smaller than what rounding of a direction leaves

    /// One lane, so that a level of a descent is one load.
    struct Node {
        float left;                     ///< probability of the two quadrants of lower x
        float lower_left, lower_right;  ///< of the lower y, among the two of lower x and among the others
        uint32_t children;              ///< node of each quadrant, a byte each; 0: a cell
    };
    Lane* nodes;  ///< [leaf][node]

    /// A cell: a quadrant of a node of the quadtree of a leaf; its side is 2^-level.
    struct Cell {
        uint32_t node, quadrant, level;
        float density;  ///< per area of the square
        Vec2f at;       ///< the point
    };

    AMBILUX_HD static float side(uint32_t level) {
        return bits_float(FloatBits(kExponentBias - level) << kFractionBits);
    }
    AMBILUX_HD static uint32_t child(uint32_t children, uint32_t quadrant) { return children >> 8 * quadrant & 0xffu; }
    AMBILUX_HD static float of(Vec4f m, uint32_t quadrant) {
        const float low = quadrant & 1u ? m.y : m.x, high = quadrant & 1u ? m.w : m.z;
        return quadrant & 2u ? high : low;
    }
    /// Of probabilities of the four quadrants.
    AMBILUX_HD static Node node(Vec4f p, uint32_t children) {
        return {(p.x + p.z) / ((p.x + p.z) + (p.y + p.w)), p.x / (p.x + p.z), p.y / (p.y + p.w), children};
    }
    /// Down to the cell of point `u` of the square; if `sampled`, to one in proportion to the masses and a point in it:
    /// halves then end at their probability, not in the middle. One loop for both, since both are met by a warp.
    AMBILUX_HD Cell descend(uint32_t leaf, Vec2f u, bool sampled) const {
        Cell c = {0, 0, 0, 1.0f, {0.0f, 0.0f}};
        float side = 1.0f;
        for (uint32_t next = 0;;) {
            const Node n = start_of<Node>(nodes[leaf * kNodes + next]);
            const uint32_t x = pick_half(n.left, sampled, u.x, c.density);
            const uint32_t y = pick_half(x ? n.lower_right : n.lower_left, sampled, u.y, c.density);
            side *= 0.5f;
            c = {next, x + 2 * y, c.level + 1, c.density, {c.at.x + float(x) * side, c.at.y + float(y) * side}};
            next = child(n.children, c.quadrant);
            if (next != 0) continue;
            c.at = {c.at.x + side * u.x, c.at.y + side * u.y};
            return c;
        }
    }
    AMBILUX_HD Cell cell(uint32_t leaf, Vec2f u) const { return descend(leaf, u, false); }

private:
    /// Which half `u` in [0,1) falls to, the first with probability `first`; `u` is uniform in that half after it.
    AMBILUX_HD static uint32_t pick_half(float first, bool sampled, float& u, float& density) {
        const float end = sampled ? first : 0.5f;
        const bool second = !(u < end);
        u = second ? (u - end) / (1.0f - end) : u / end;
        u = clamp(u, 0.0f, kOneMinusEpsilon);
        density *= 2.0f * (second ? 1.0f - first : first);
        return second;
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

    /// Cells of the cube, by x, y and z, from which descents begin: what kGridDepth halvings lead to.
    static constexpr uint32_t kGridSide = 32, kGridDepth = 15, kGridCells = kGridSide * kGridSide * kGridSide;

    uint32_t* space;  ///< with kLeafBit a leaf, else the node of the lower half, which that of the upper one follows
    uint32_t* grid;   ///< [cell]: as of space
    GuideLeaf* leaves;
    GuideQuads quads;
    Vec3f low;  ///< corner of the cube around the scene
    float inverse_side;

    /// In the unit cube.
    AMBILUX_HD Vec3f unit(Vec3f p) const {
        const Vec3f x = (p - low) * inverse_side;
        return {clamp(x.x, 0.0f, kOneMinusEpsilon), clamp(x.y, 0.0f, kOneMinusEpsilon),
                clamp(x.z, 0.0f, kOneMinusEpsilon)};
    }
    AMBILUX_HD uint32_t find(Vec3f x) const {
        x = x * float(kGridSide);
        const uint32_t i = uint32_t(x.x), j = uint32_t(x.y), k = uint32_t(x.z);
        return descend(grid[(k * kGridSide + j) * kGridSide + i], {x.x - float(i), x.y - float(j), x.z - float(k)},
                       ~0u) &
               ~kLeafBit;
    }
    /// From an entry of `space` down to a leaf, at most so many levels, at a point of its unit cube.
    AMBILUX_HD uint32_t descend(uint32_t node, Vec3f x, uint32_t levels) const {
        for (; levels > 0 && !(node & kLeafBit); --levels) {
            const float twice = 2.0f * x.x;
            const uint32_t upper = twice >= 1.0f;
            x = {x.y, x.z, twice - float(upper)};
            node = space[node + upper];
        }
        return node;
    }
    AMBILUX_HD uint32_t leaf(Vec3f p) const { return find(unit(p)); }
    AMBILUX_HD float pdf_sa(uint32_t leaf, Vec3f d) const {
        return kInv4Pi * quads.cell(leaf, square_of_direction(d)).density;
    }
};

}  // namespace ambilux
