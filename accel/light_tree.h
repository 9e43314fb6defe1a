// Builds the tree by which next event estimation may pick lights (scene/light_tree.h).
#pragma once

#include <vector>

#include "scene/light_tree.h"
#include "scene/scene.h"

namespace ambilux {

/// Of a scene's emitters, by the surface area orientation heuristic (Conty Estevez and Kulla 2018). The same nodes
/// whatever the number of threads.
class LightTree {
public:
    /// Throws Error(bad_input) if there are more lights than leaves can number.
    explicit LightTree(const Scene& scene);
    LightTree(const LightTree&) = delete;
    LightTree& operator=(const LightTree&) = delete;

    /// For SceneView::light_tree; valid as long as this object.
    const LightTreeView* view() const { return &view_; }
    const std::vector<LightNode>& nodes() const { return nodes_; }
    const std::vector<LightLeaf>& leaves() const { return leaves_; }
    const std::vector<uint32_t>& first_leaf() const { return first_leaf_; }
    const std::vector<uint32_t>& beside() const { return beside_; }
    /// What light_tree_bytes() predicts.
    uint64_t memory_bytes() const;

private:
    std::vector<LightNode> nodes_;
    std::vector<LightLeaf> leaves_;
    std::vector<uint32_t> first_leaf_, beside_;
    LightTreeView view_;
};

}  // namespace ambilux
