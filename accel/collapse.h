// Wide nodes of a binary tree: how it is cut into them at the least expected cost, and what a node is made of. Builders
// of the host and of a device have this in common.
#pragma once

#include <cmath>

#include "accel/cwbvh_node.h"
#include "scene/primitive_bounds.h"

namespace ambilux::collapse {

constexpr uint32_t kWidth = 8;
constexpr uint32_t kMostInLeaf = 3;
/// Cost of testing a node's children and one primitive (Ylitie et al. 2017, section 5.1).
constexpr float kNodeCost = 1.0f, kPrimitiveCost = 0.3f;
/// And of going into an instance.
constexpr float kInstanceCost = 6.0f;

/// How a binary subtree is best represented by a given number of wide nodes or leaves, in one word.
struct How {
    uint32_t word;

    /// Of so many children (at most kWidth): how many the left subtree gets; 0: as with one child less.
    AMBILUX_HD uint32_t left_share(uint32_t count) const { return count < 2 ? 0 : word >> 3 * (count - 2) & 7u; }
    /// In the subtree, at most kMostInLeaf + 1.
    AMBILUX_HD uint32_t primitives() const { return word >> 21 & 7u; }
    /// A single child is best made a leaf.
    AMBILUX_HD bool is_leaf() const { return word >> 24 & 1u; }
};

AMBILUX_HD How make_how(uint32_t shares, uint32_t primitives, bool leaf) {
    return {shares | primitives << 21 | uint32_t(leaf) << 24};
}

/// And what it costs with at most 1, 2, ... children.
struct Plan {
    float cost[kWidth - 1];
    How how;
};

AMBILUX_HD Plan plan_of_single(float cost, How how) {
    Plan plan;
    for (float& c : plan.cost) c = cost;
    plan.how = how;
    return plan;
}
AMBILUX_HD How primitive_how() { return make_how(0, 1, true); }
AMBILUX_HD Plan primitive_plan(float area) { return plan_of_single(area * kPrimitiveCost, primitive_how()); }
/// Never part of a leaf.
AMBILUX_HD Plan instance_plan(float area) {
    return plan_of_single(area * kInstanceCost, make_how(0, kMostInLeaf + 1, false));
}

/// Dynamic programming from the leaves up (equations 1-5 of the paper).
AMBILUX_HD Plan inner_plan(const Plan& left, const Plan& right, float area) {
    Plan plan;
    uint32_t shares = 0;
    float distribute[kWidth];
    for (uint32_t count = 2; count <= kWidth; ++count) {
        float best = kInfinity;
        uint32_t share = 1;
        for (uint32_t k = 1; k < count; ++k) {
            const float c = left.cost[k - 1] + right.cost[count - k - 1];
            if (c < best) best = c, share = k;
        }
        distribute[count - 1] = best;
        shares |= share << 3 * (count - 2);
    }
    const uint32_t all = left.how.primitives() + right.how.primitives(),
                   primitives = all < kMostInLeaf + 1 ? all : kMostInLeaf + 1;
    const float inner = distribute[kWidth - 1] + area * kNodeCost;
    const float leaf = primitives <= kMostInLeaf ? area * kPrimitiveCost * float(primitives) : kInfinity;
    plan.cost[0] = leaf < inner ? leaf : inner;
    for (uint32_t count = 2; count < kWidth; ++count) {
        plan.cost[count - 1] = distribute[count - 1];
        if (distribute[count - 1] < plan.cost[count - 2]) continue;
        plan.cost[count - 1] = plan.cost[count - 2];
        shares &= ~(7u << 3 * (count - 2));
    }
    plan.how = make_how(shares, primitives, primitives <= kMostInLeaf && leaf <= inner);
    return plan;
}

/// Children of a wide node as binary nodes.
struct Children {
    uint32_t node[kWidth];
    uint32_t count = 0;
};

/// Of the wide node that binary node `root` becomes. `Tree`: how(node), left(node), right(node).
template <class Tree>
AMBILUX_HD Children children_of(const Tree& tree, uint32_t root) {
    struct Part {
        uint32_t node, count;
    };
    Part stack[kWidth];  // counts add up to kWidth at most
    int top = 0;
    // The root of a tiny scene is a leaf, its own only child.
    stack[top++] = {root, tree.how(root).is_leaf() ? 1 : kWidth};
    Children out;
    while (top > 0) {
        Part part = stack[--top];
        const How how = tree.how(part.node);
        while (part.count > 1 && how.left_share(part.count) == 0) --part.count;
        if (part.count == 1) {
            out.node[out.count++] = part.node;
            continue;
        }
        const uint32_t k = how.left_share(part.count);
        stack[top++] = {tree.right(part.node), part.count - k};
        stack[top++] = {tree.left(part.node), k};
    }
    return out;
}

/// The child of each slot of a wide node, or kNone.
struct Slots {
    uint32_t node[kWidth];
};
AMBILUX_HD Slots no_children() {
    Slots slots;
    for (uint32_t& node : slots.node) node = kNone;
    return slots;
}

/// What CwbvhNode::valid says of a slot.
AMBILUX_HD uint32_t inner_bit(uint32_t slot) { return 1u << (24 + slot); }
AMBILUX_HD uint32_t leaf_bits(uint32_t slot, uint32_t primitives) { return ((1u << primitives) - 1) << 3 * slot; }

/// What it brings to have a child whose box lies by `d` off the middle of its node's in slot s, which belongs to the
/// corner whose bit k says "upper side of axis k": the projection on that diagonal (section 3.2).
AMBILUX_HD float slot_gain(Vec3f d, uint32_t s) {
    return (s & 1 ? d.x : -d.x) + (s & 2 ? d.y : -d.y) + (s & 4 ? d.z : -d.z);
}
AMBILUX_HD Vec3f off_middle(const Bounds3f& child, const Bounds3f& node) {
    return (child.lower - node.lower) + (child.upper - node.upper);
}

/// 2^e for exponents of normal doubles, and the least e with 2^e >= x for a positive normal x: exact anywhere.
AMBILUX_HD double power_of_two(int e) {
    const uint64_t bits = uint64_t(e + 1023) << 52;
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
AMBILUX_HD int ceil_log2(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return int(bits >> 52 & 2047u) - 1023 + ((bits & ((uint64_t(1) << 52) - 1)) != 0);
}

/// Exponent of the quantisation step for children in [lower, upper], and the corner they are counted from.
AMBILUX_HD int choose_grid(float lower, float upper, float& corner) {
    const double extent = double(upper) - double(lower), magnitude = fmax(fabs(double(lower)), fabs(double(upper)));
    // Not finer than what floats at these coordinates can tell apart.
    const double least = fmax(magnitude * 0x1p-21, 0x1p-90);
    int e = ceil_log2(fmax(extent / 254.5, least));
    for (;; ++e) {
        const double step = power_of_two(e);
        corner = next_float_down(float(double(lower) - 0.0625 * step));
        if (ceil((double(upper) - double(corner)) / step + double(kCwbvhMargin)) <= 255.0) break;
    }
    return e < -126 - 15 ? -126 - 15 : e > 127 - 15 ? 127 - 15 : e;
}

AMBILUX_HD uint8_t grid_byte(double steps) {
    // Clamped, never wrapped: choose_grid leaves room for all.
    return uint8_t(steps < 0.0 ? 0.0 : steps > 255.0 ? 255.0 : steps);
}

AMBILUX_HD CwbvhNode empty_node() {
    CwbvhNode n = {};
    n.scale_xz = 0x3f803f80u, n.scale_y = 1.0f;
    return n;
}

/// A node with the boxes of its children; who they are is left open. `Tree`: bounds(node).
template <class Tree>
AMBILUX_HD CwbvhNode node_of_boxes(const Tree& tree, const Slots& slots) {
    CwbvhNode node = empty_node();
    Bounds3f bounds;
    for (const uint32_t child : slots.node)
        if (child != kNone) bounds.extend(tree.bounds(child));
    double step[3];
    float scale[3];
    for (int axis = 0; axis < 3; ++axis) {
        const int exponent = choose_grid(bounds.lower[axis], bounds.upper[axis], node.p[axis]);
        step[axis] = power_of_two(exponent);
        scale[axis] = float(power_of_two(exponent + 15));
    }
    node.scale_xz = float_bits(scale[0]) | float_bits(scale[2]) >> 16;
    node.scale_y = scale[1];
    uint32_t lower[3][2] = {}, upper[3][2] = {};
    for (uint32_t slot = 0; slot < kWidth; ++slot) {
        if (slots.node[slot] == kNone) continue;
        const Bounds3f b = tree.bounds(slots.node[slot]);
        for (int axis = 0; axis < 3; ++axis) {
            const double from = double(node.p[axis]), margin = double(kCwbvhMargin);
            const uint8_t lo = grid_byte(floor((double(b.lower[axis]) - from) / step[axis] - margin)),
                          hi = grid_byte(ceil((double(b.upper[axis]) - from) / step[axis] + margin));
            lower[axis][slot / 4] |= uint32_t(lo) << 8 * (slot % 4);
            upper[axis][slot / 4] |= uint32_t(hi) << 8 * (slot % 4);
        }
    }
    for (int half = 0; half < 2; ++half) {
        node.lower_x[half] = lower[0][half], node.lower_y[half] = lower[1][half], node.lower_z[half] = lower[2][half];
        node.upper_x[half] = upper[0][half], node.upper_y[half] = upper[1][half], node.upper_z[half] = upper[2][half];
    }
    return node;
}

}  // namespace ambilux::collapse
