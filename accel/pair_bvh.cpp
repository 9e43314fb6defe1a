#include "accel/pair_bvh.h"

#include <algorithm>
#include <chrono>
#include <string>

#include "accel/bvh2.h"
#include "core/error.h"
#include "scene/scene.h"

namespace ambilux {

namespace {

constexpr uint32_t kMaxLeafSize = 4;
/// Cost of testing a pair of boxes and one primitive.
constexpr float kNodeCost = 1.0f, kPrimitiveCost = 1.0f;

class Pairer {
public:
    Pairer(const SceneView& scene, const Bvh2& bvh)
        : scene_(scene), bvh_(bvh), count_(bvh.nodes.size()), cost_(bvh.nodes.size()), leaf_(bvh.nodes.size()) {}

    PairArrays run() {
        if (bvh_.root == kNone) return {};
        choose_leaves();
        struct Task {
            uint32_t binary, node, side, depth;
        };
        std::vector<Task> tasks = {{bvh_.root, kNone, 0, 1}};
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            if (task.depth > uint32_t(kPairStackSize))
                throw Error(ExitCode::device,
                            "binary BVH: deeper than the traversal stack of " + std::to_string(kPairStackSize));
            const uint32_t reference = leaf_[task.binary] ? make_leaf(task.binary) : uint32_t(out_.nodes.size());
            (task.node == kNone ? out_.root : out_.nodes[task.node].child[task.side]) = reference;
            if (leaf_[task.binary]) continue;
            const Bvh2Node& n = bvh_.nodes[task.binary];
            PairNode pair = {};
            set_box(pair, 0, bvh_.nodes[n.left].bounds);
            set_box(pair, 1, bvh_.nodes[n.right].bounds);
            out_.nodes.push_back(pair);
            tasks.push_back({n.right, reference, 1, task.depth + 1});
            tasks.push_back({n.left, reference, 0, task.depth + 1});
        }
        return std::move(out_);
    }

private:
    void choose_leaves() {
        std::vector<uint32_t> order = {bvh_.root};
        for (size_t i = 0; i < order.size(); ++i) {
            const Bvh2Node& n = bvh_.nodes[order[i]];
            if (!n.is_leaf()) order.push_back(n.left), order.push_back(n.right);
        }
        for (size_t i = order.size(); i-- > 0;) {
            const uint32_t at = order[i];
            const Bvh2Node& n = bvh_.nodes[at];
            const float area = n.bounds.half_area();
            count_[at] = n.is_leaf() ? 1 : std::min(count_[n.left] + count_[n.right], kMaxLeafSize + 1);
            const float leaf = count_[at] <= kMaxLeafSize ? area * kPrimitiveCost * float(count_[at]) : kInfinity;
            const float inner = n.is_leaf() ? kInfinity : area * kNodeCost + cost_[n.left] + cost_[n.right];
            leaf_[at] = leaf <= inner;
            cost_[at] = std::min(leaf, inner);
        }
    }

    uint32_t make_leaf(uint32_t node) {
        std::vector<uint32_t> prims, stack = {node};
        while (!stack.empty()) {
            const Bvh2Node& n = bvh_.nodes[stack.back()];
            stack.pop_back();
            if (!n.is_leaf())
                stack.push_back(n.right), stack.push_back(n.left);
            else if (std::find(prims.begin(), prims.end(), n.prim) == prims.end())
                prims.push_back(n.prim);  // parts of one triangle may meet again
        }
        const uint32_t first = uint32_t(out_.primitives.size());
        for (const uint32_t prim : prims) out_.primitives.push_back(make_cwbvh_primitive(scene_, prim));
        return kPairLeaf | first << 3 | uint32_t(prims.size());
    }

    /// Larger by what rounding in triangle tests may make of a vertex.
    static void set_box(PairNode& pair, int side, const Bounds3f& bounds) {
        float lower[3], upper[3];
        for (int axis = 0; axis < 3; ++axis) {
            const float pad = gamma_bound(8) * std::max(std::fabs(bounds.lower[axis]), std::fabs(bounds.upper[axis]));
            lower[axis] = bounds.lower[axis] - pad, upper[axis] = bounds.upper[axis] + pad;
        }
        float* xy = pair.xy[side];
        xy[0] = lower[0], xy[1] = upper[0], xy[2] = lower[1], xy[3] = upper[1];
        pair.z[2 * side] = lower[2], pair.z[2 * side + 1] = upper[2];
    }

    const SceneView& scene_;
    const Bvh2& bvh_;
    std::vector<uint32_t> count_;  ///< primitives in the subtree, at most kMaxLeafSize + 1
    std::vector<float> cost_;
    std::vector<uint8_t> leaf_;
    PairArrays out_;
};

}  // namespace

static_assert(kMostBvh2Depth <= uint32_t(kPairStackSize));
PairArrays pair_bvh2(const SceneView& scene, const Bvh2& bvh) { return Pairer(scene, bvh).run(); }

PairAccel::PairAccel(const Scene& scene) {
    const auto start = std::chrono::steady_clock::now();
    const SceneView view = scene.view();
    if (view.instance_count)
        throw Error(ExitCode::usage, "binary BVHs have one level: scenes with instances need another structure");
    arrays_ = pair_bvh2(view, build_optimised_bvh2(view));
    build_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace ambilux
