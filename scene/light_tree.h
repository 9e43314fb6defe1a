// The tree by which next event estimation may pick lights (Conty Estevez and Kulla 2018, "Importance Sampling of Many
// Lights with Adaptive Tree Splitting"), as kernels see it. transport/emitter/light_tree.h goes down in it,
// accel/light_tree.h builds it; docs/theory.md has the formulas.
#pragma once

#include "scene/view.h"

namespace ambilux {

struct Scene;

/// Lights that lie together: a sphere around them and a cone of directions. All light leaves within `theta_e` of a
/// direction of the cone of half angle `theta_o` around `axis`.
struct alignas(16) LightNode {
    Vec3f center;
    float radius;
    Vec3f axis;    ///< unit
    float energy;  ///< 1/sr: sum of the lights' shares of the power, each per solid angle about its own axis
    float cos_o, sin_o;
    float cos_e;    ///< a little less than that of theta_e
    uint32_t next;  ///< the left of its two children, the right one lies behind it; of a leaf kLightLeaf and its number
};
constexpr uint32_t kLightLeaf = 0x80000000u;

/// A light that is picked as a whole: an emitter, or a triangle of one.
struct alignas(16) LightLeaf {
    uint32_t emitter;
    uint32_t path;        ///< bit k: on the way down it lies in the right child of the node at depth k
    float scale;          ///< over_power of its pick is kPowerShare + scale · probability in the tree
    float32 u_primitive;  ///< of a triangle: a number by which the emitter's own table picks it; else negative
};

/// Share of picks by power, whatever the receiver: all that the tree believes of it can be wrong. Second moments are at
/// most 1/(1 - share) of those of the tree alone, and 1/share of those of picks by power. A power of two.
constexpr float kPowerShare = 1.0f / 16;

/// What SceneView::light_tree points to.
struct LightTreeView {
    const LightNode* nodes;  ///< the first is the root
    const LightLeaf* leaves;
    const uint32_t* first_leaf;  ///< of each emitter; its triangles follow each other. kLightBeside, kNone
    const uint32_t* beside;      ///< emitters at infinity, which are picked beside the tree by power
    uint32_t beside_count;
    float reached;            ///< power share of all that next event estimation can pick, beams left out
    float in_tree;            ///< of what lies in the tree
    float beside_over_power;  ///< of emitters beside the tree
};
/// In first_leaf: beside the tree. kNone: picked by power alone, since no light of it can be found by next event
/// estimation, or since there is none.
constexpr uint32_t kLightBeside = kNone - 1;

/// Leaves that a tree over the emitters of `scene` has.
uint64_t light_leaf_count(const Scene& scene);
/// Bytes of such a tree, on a host or on a device.
uint64_t light_tree_bytes(const Scene& scene);
/// False where a tree has next to nothing to choose from: one lamp of two triangles at most. Then lights are picked by
/// power, by kernels that know of no tree.
bool light_tree_pays(const Scene& scene);
/// The emitter is picked triangle by triangle.
bool has_light_leaf_per_triangle(const Emitter& emitter);
/// The emitter lies in the tree.
bool is_in_light_tree(const Emitter& emitter);

}  // namespace ambilux
