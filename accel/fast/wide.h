// The wide tree from the root down, level by level.
#pragma once

#include "accel/cwbvh.h"
#include "accel/fast/clusters.h"

namespace ambilux::fast {

/// Children in slots: each into the corner it lies in, then exchanged in pairs as long as that brings something. An
/// optimal assignment (collapse_bvh2) traces no faster.
AMBILUX_HD collapse::Slots choose_slots(const Tree& tree, uint32_t node) {
    using namespace collapse;
    const Children children = children_of(tree, node);
    const Bounds3f bounds = tree.bounds(node);
    Slots slots = no_children();
    Vec3f off[kWidth];
    for (Vec3f& d : off) d = {0, 0, 0};  // an empty slot gains nothing
    for (uint32_t c = 0; c < children.count; ++c) {
        slots.node[c] = children.node[c];
        off[c] = off_middle(tree.bounds(children.node[c]), bounds);
    }
    for (bool better = true; better;) {
        better = false;
        for (uint32_t a = 0; a < kWidth; ++a)
            for (uint32_t b = a + 1; b < kWidth; ++b) {
                const float now = slot_gain(off[a], a) + slot_gain(off[b], b),
                            then = slot_gain(off[a], b) + slot_gain(off[b], a);
                // By more than rounding, so that it ends.
                if (!(then - now > 1e-5f * (fabsf(then) + fabsf(now)))) continue;
                const Vec3f d = off[a];
                off[a] = off[b], off[b] = d;
                const uint32_t n = slots.node[a];
                slots.node[a] = slots.node[b], slots.node[b] = n;
                better = true;
            }
    }
    return slots;
}

/// Primitives of a leaf.
struct LeafPrimitives {
    uint32_t prim[collapse::kMostInLeaf] = {};
    uint32_t count = 0;
};

AMBILUX_HD LeafPrimitives primitives_of_leaf(const Tree& tree, uint32_t node) {
    LeafPrimitives found;
    uint32_t stack[collapse::kMostInLeaf];
    int top = 0;
    stack[top++] = node;
    while (top > 0) {
        const uint32_t at = stack[--top];
        if (at < tree.leaves) {
            found.prim[found.count++] = tree.right(at);
            continue;
        }
        stack[top++] = tree.right(at);
        stack[top++] = tree.left(at);
    }
    return found;
}

/// Wide nodes by their binary nodes, those of a level side by side.
struct WideNodes {
    uint32_t *binary, *first_child, *first_primitive;
};

/// Inner children and primitives of node first + i of a level of `count`; of node first + count none, so that sums end
/// with all.
struct CountChildren {
    Tree tree;
    const uint32_t* binary;  ///< of the level
    uint32_t count;
    uint32_t *inner, *primitives;

    AMBILUX_HD void operator()(uint32_t i) const {
        inner[i] = primitives[i] = 0;
        if (i >= count) return;
        const collapse::Children children = collapse::children_of(tree, binary[i]);
        for (uint32_t c = 0; c < children.count; ++c) {
            const collapse::How how = tree.how(children.node[c]);
            if (how.is_leaf())
                primitives[i] += how.primitives();
            else
                ++inner[i];
        }
    }
};

/// Puts the children of a level behind it, once `inner` and `primitives` are sums of what is before each node.
struct PlaceChildren {
    Tree tree;
    WideNodes wide;
    uint32_t first, next, next_primitive;  ///< nodes of the level, of the next one, primitives of this one
    const uint32_t *inner, *primitives;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t node = first + i;
        uint32_t child = next + inner[i];
        wide.first_child[node] = child;
        wide.first_primitive[node] = next_primitive + primitives[i];
        const collapse::Slots slots = choose_slots(tree, wide.binary[node]);
        for (const uint32_t c : slots.node)
            if (c != kNone && !tree.how(c).is_leaf()) wide.binary[child++] = c;
    }
};

/// Writes node i of all and its primitives.
struct WriteNodes {
    SceneView scene;
    Tree tree;
    WideNodes wide;
    CwbvhNode* nodes;
    CwbvhPrimitive* primitives;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (tree.leaves == 0) {
            nodes[i] = collapse::empty_node();
            return;
        }
        const collapse::Slots slots = choose_slots(tree, wide.binary[i]);
        CwbvhNode node = collapse::node_of_boxes(tree, slots);
        node.first_child = wide.first_child[i];
        node.first_primitive = wide.first_primitive[i];
        uint32_t next = node.first_primitive;
        for (uint32_t slot = 0; slot < collapse::kWidth; ++slot) {
            const uint32_t child = slots.node[slot];
            if (child == kNone) continue;
            if (!tree.how(child).is_leaf()) {
                node.valid |= collapse::inner_bit(slot);
                continue;
            }
            const LeafPrimitives found = primitives_of_leaf(tree, child);
            node.valid |= collapse::leaf_bits(slot, found.count);
            for (uint32_t k = 0; k < found.count; ++k) primitives[next++] = make_cwbvh_primitive(scene, found.prim[k]);
        }
        nodes[i] = node;
    }
};

}  // namespace ambilux::fast
