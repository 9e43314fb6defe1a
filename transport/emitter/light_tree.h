// Lights picked by a tree (scene/light_tree.h): what each can bring to the receiver decides. Going down, one random
// number chooses between two children in proportion to their importance, and is rescaled. The probability of a light is
// the product of these choices along its path, which its leaf stores; that of a light that was found in another way
// takes the same steps in the same order, so that both are equal to the last bit.
#pragma once

#include "scene/light_tree.h"
#include "transport/emitter/lights.h"

namespace ambilux {

namespace detail {

/// Factors for angles are no less than this: bounds are rounded, and lights that graze a surface still light it.
constexpr float kLeastLightCosine = 1e-3f;

/// Cosine and sine of max(a - b, 0) from those of a and b in [0, pi].
struct AngleParts {
    float cosine, sine;
};
AMBILUX_HD AngleParts angle_beyond(AngleParts a, AngleParts b) {
    if (a.cosine > b.cosine) return {1.0f, 0.0f};
    return {fmaf(a.cosine, b.cosine, a.sine * b.sine), fmaf(a.sine, b.cosine, -(a.cosine * b.sine))};
}
AMBILUX_HD AngleParts angle_of(float cosine) {
    const float c = max(-1.0f, min(1.0f, cosine));
    return {c, safe_sqrt(fmaf(-c, c, 1.0f))};
}

/// What the lights of `node` can bring to a receiver at `p` with normal `n`, or with none if that is 0: at most about
/// energy / distance², with the least angles that the sphere around them allows at either end.
AMBILUX_HD float light_importance(const LightNode& node, Vec3f p, Vec3f n) {
    const Vec3f to = node.center - p;
    const float d2 = fmaf(to.x, to.x, fmaf(to.y, to.y, to.z * to.z)), r2 = max(node.radius * node.radius, 1e-30f);
    if (d2 <= r2) return node.energy / r2;
    const float inv = 1.0f / sqrtf(d2), sine = node.radius * inv;
    const AngleParts spread = {safe_sqrt(fmaf(-sine, sine, 1.0f)), sine};
    const float along = fmaf(node.axis.x, to.x, fmaf(node.axis.y, to.y, node.axis.z * to.z)) * -inv;
    const AngleParts leaving = angle_beyond(angle_beyond(angle_of(along), {node.cos_o, node.sin_o}), spread);
    if (leaving.cosine <= node.cos_e) return 0.0f;
    float importance = node.energy * max(leaving.cosine, kLeastLightCosine) / d2;
    if (n.x != 0.0f || n.y != 0.0f || n.z != 0.0f) {
        const float across = fmaf(n.x, to.x, fmaf(n.y, to.y, n.z * to.z)) * inv;
        importance *= max(angle_beyond(angle_of(fabsf(across)), spread).cosine, kLeastLightCosine);
    }
    return importance;
}

/// Probability of the first of two children. Apart, so that all who go down compute the same bits.
AMBILUX_HD_APART float left_light_share(const LightNode* children, Vec3f p, Vec3f n) {
    const LightNode a = children[0], b = children[1];
    const float left = light_importance(a, p, n), right = light_importance(b, p, n);
    if (left + right > 0.0f) return left / (left + right);
    return a.energy / (a.energy + b.energy);
}

}  // namespace detail

/// A normal in ten bits for each coordinate. A receiver's normal is rounded so for all who go down in the tree: rays
/// keep no more of it. Rounded again it is the same.
struct CoarseNormal {
    uint32_t bits;

    AMBILUX_HD static CoarseNormal pack(Vec3f n) { return {word(n.x) | word(n.y) << 10 | word(n.z) << 20}; }
    AMBILUX_HD Vec3f unpack() const { return {number(bits), number(bits >> 10), number(bits >> 20)}; }

private:
    static constexpr int32_t kMost = 511;

    AMBILUX_HD static uint32_t word(float x) {
        return uint32_t(int32_t(floorf(x * float(kMost) + 0.5f)) + kMost) & 1023u;
    }
    AMBILUX_HD static float number(uint32_t w) { return float(int32_t(w & 1023u) - kMost) * (1.0f / float(kMost)); }
};

/// By the tree, and with a share of kPowerShare by power; where there is no tree, all by power. `u` of a pick are the
/// random numbers for the sample on the light: z has decided between the two, and w leads to the triangle that was
/// picked.
struct LightsByTree {
    char nothing[0];  ///< no size, as BsdfDirections

    struct Pick {
        uint32_t emitter;
        float over_power;
        Vec4f u;
    };
    AMBILUX_HD static Pick pick(const SceneView& view, Receiver receiver, Vec4f u) {
        if (!view.light_tree) return {LightsByPower::pick(view, receiver, u).emitter, 1.0f, u};
        const LightTreeView& tree = *view.light_tree;
        if (u.z < kPowerShare) {
            u.z *= 1.0f / kPowerShare;
            const uint32_t emitter = sample_cdf(view.emitter_cdf, view.emitter_count, u.x);
            uint32_t leaf = tree.first_leaf[emitter];
            if (leaf >= kLightBeside) return {emitter, over_power_beside(tree, leaf), u};
            if (tree.leaves[leaf].u_primitive >= 0.0f) {
                const Emitter& e = view.emitters[emitter];
                leaf += sample_cdf(view.tables + e.area_cdf, view.shapes[e.shape].primitive_count, u.w);
            }
            return at(tree, leaf, probability(tree, leaf, receiver), u);
        }
        u.z = min((u.z - kPowerShare) * (1.0f / (1.0f - kPowerShare)), kOneMinusEpsilon);
        float x = u.x * tree.reached;
        for (uint32_t i = 0; i < tree.beside_count; ++i) {
            const uint32_t emitter = tree.beside[i];
            const float p = view.emitters[emitter].pick_probability;
            if (x < p || (i + 1 == tree.beside_count && tree.in_tree == 0.0f))
                return {emitter, tree.beside_over_power, u};
            x -= p;
        }
        x = min(x / tree.in_tree, kOneMinusEpsilon);
        const Vec3f n = CoarseNormal::pack(receiver.n).unpack();
        float p = 1.0f;
        uint32_t node = tree.nodes[0].next;
        while (!(node & kLightLeaf)) {
            const float left = detail::left_light_share(tree.nodes + node, receiver.p, n);
            const bool right = x >= left;
            const float share = right ? 1.0f - left : left;
            x = min((right ? x - left : x) / share, kOneMinusEpsilon);
            p *= share;
            node = tree.nodes[node + uint32_t(right)].next;
        }
        return at(tree, node & ~kLightLeaf, p, u);
    }
    AMBILUX_HD static float over_power(const SceneView& view, Receiver receiver, uint32_t emitter, uint32_t prim) {
        if (!view.light_tree) return 1.0f;
        const LightTreeView& tree = *view.light_tree;
        uint32_t leaf = tree.first_leaf[emitter];
        if (leaf >= kLightBeside) return over_power_beside(tree, leaf);
        if (tree.leaves[leaf].u_primitive >= 0.0f)
            leaf += prim - view.shapes[view.emitters[emitter].shape].first_primitive;
        return over_power_at(tree.leaves[leaf].scale, probability(tree, leaf, receiver));
    }
    /// Of a leaf, given that the tree decides.
    AMBILUX_HD static float probability(const LightTreeView& tree, uint32_t leaf, Receiver receiver) {
        const Vec3f n = CoarseNormal::pack(receiver.n).unpack();
        float p = 1.0f;
        uint32_t node = tree.nodes[0].next, path = tree.leaves[leaf].path;
        for (; !(node & kLightLeaf); path >>= 1) {
            const float left = detail::left_light_share(tree.nodes + node, receiver.p, n);
            const bool right = path & 1u;
            p *= right ? 1.0f - left : left;
            node = tree.nodes[node + uint32_t(right)].next;
        }
        return p;
    }

private:
    AMBILUX_HD static float over_power_at(float scale, float p) { return fmaf(scale, p, kPowerShare); }
    AMBILUX_HD static float over_power_beside(const LightTreeView& tree, uint32_t leaf) {
        return leaf == kLightBeside ? tree.beside_over_power : kPowerShare;
    }
    AMBILUX_HD static Pick at(const LightTreeView& tree, uint32_t leaf, float p, Vec4f u) {
        const LightLeaf l = tree.leaves[leaf];
        if (l.u_primitive >= 0.0f) u.w = l.u_primitive;
        return {l.emitter, over_power_at(l.scale, p), u};
    }
};

}  // namespace ambilux
