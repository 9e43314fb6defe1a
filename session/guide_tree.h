// What path guiding has learned: its trees as plain arrays, what they are like, and pictures of them.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "film/layer.h"
#include "integrators/shared/guide/state.h"
#include "render/replay/replay.h"
#include "scene/scene.h"

namespace ambilux {

/// What the subpaths of a side, "eye" or "light", follow in a sample, for as long as the pointer lives. Throws
/// Error(usage), with `prefix` before it, where a method guides none.
std::shared_ptr<const GuidedState> guide_of(const Replay& replay, uint32_t sample, const std::string& side,
                                            const std::string& prefix);

/// Leaves of the tree over space, one an entry, and nodes of their quadtrees over directions, leaf after leaf.
struct GuideArrays {
    std::vector<std::array<double, 3>> low, high;   ///< boxes, in coordinates of the scene's file
    std::vector<float> bsdf_share;                  ///< of directions that the BSDF samples; 1: nothing was learned
    std::vector<float> reflected;                   ///< mean radiance that eye rays bring; 0: not known
    std::vector<uint32_t> depth, first, count;      ///< halvings of the cube; nodes of the quadtree
    std::vector<std::array<float, 4>> probability;  ///< of the quadrants x + 2y of a node
    std::vector<std::array<int32_t, 4>> child;      ///< entry of the node that a quadrant is; -1: a cell
    uint32_t updates = 0;                           ///< of the trees
};
GuideArrays guide_arrays(const GuidedState& guide, const Scene& scene);

/// updates, leaves, most_leaves, learned_leaves, deepest_leaf, nodes, most_nodes, deepest_cell, mean_bsdf_share.
nlohmann::json guide_json(const GuideArrays& arrays, const GuidedState& guide);
/// The same in a line.
std::string guide_text(const nlohmann::json& json);

constexpr uint32_t kGuidePictureWidth = 128, kGuidePictureHeight = 64;
/// Density of directions that was learned at `p`, in coordinates of the renderer, times 4 pi: 1 is even. The column is
/// the angle φ about +z, from 0 to 2π, the row (1 - cos θ) / 2 from +z down to -z: areas are solid angles.
Layer guide_layer(const GuidedState& guide, Vec3f p, const std::string& name);

}  // namespace ambilux
