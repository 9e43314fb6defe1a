// Binary bounding volume hierarchies with one primitive per leaf: what wide trees are made from.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/primitive_bounds.h"
#include "scene/view.h"

namespace ambilux {

struct Bvh2Node {
    Bounds3f bounds;
    uint32_t left = kNone, right = kNone;  ///< kNone in leaves
    uint32_t prim = kNone;                 ///< kNone in inner nodes
    bool is_leaf() const { return left == kNone; }
};

/// Binary tree; `root` is kNone when there is nothing to hold. A primitive may be in several leaves, each with the box
/// of its part.
struct Bvh2 {
    std::vector<Bvh2Node> nodes;
    uint32_t root = kNone;
};

/// Builds a tree over all primitives of the scene with surface-area heuristic and spatial splits (Stich et al. 2009) by
/// Embree's builder. Triangles that are not finite are left out. With `group` over its triangles alone; without, over
/// all others and instances, whose leaves have primitive_count() plus their index. Scenes with instances have no splits
/// there. Throws Error(device) when Embree fails.
Bvh2 build_bvh2(const SceneView& scene, const Group* group = nullptr);

/// Box of the part of triangle `prim` in `within` on either side of the plane x[axis] = position. Rounded outwards.
void split_triangle_bounds(const SceneView& scene, uint32_t prim, const Bounds3f& within, int axis, float position,
                           Bounds3f& left, Bounds3f& right);

/// Lowers the sum of areas of inner nodes by taking subtrees out and inserting them where they cost least (Meister and
/// Bittner 2018). Up to `passes` over the largest tenth of the nodes; the result does not depend on the number of
/// threads.
void optimise_bvh2(Bvh2& bvh, int passes);
/// Passes for trees that rays are traced through. More find little: the sum falls by 16, 10, 12 % on three published
/// scenes, by 1 % more in 16 passes.
constexpr int kReinsertionPasses = 6;

/// Nodes from the root to the deepest leaf, both counted; 0 of an empty tree.
uint32_t bvh2_depth(const Bvh2& bvh);
/// Most of it that traversal stacks have room for; the builder stays below 64.
constexpr uint32_t kMostBvh2Depth = 96;

/// The tree that rays are traced through: optimised, unless that makes it too deep. Among thousands of needles whose
/// boxes all overlap, reinsertion would chain one after the other.
Bvh2 build_optimised_bvh2(const SceneView& scene, const Group* group = nullptr);

/// Sum of half areas of inner nodes over that of the root.
double bvh2_cost(const Bvh2& bvh);

}  // namespace ambilux
