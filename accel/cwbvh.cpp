#include "accel/cwbvh.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <string>

#include "accel/bvh2.h"
#include "accel/collapse.h"
#include "core/error.h"
#include "scene/scene.h"

namespace ambilux {

namespace {

using namespace collapse;

class Collapser {
public:
    Collapser(const SceneView& scene, const Bvh2& bvh) : scene_(scene), bvh_(bvh), plans_(bvh.nodes.size()) {}

    CwbvhArrays run() {
        out_.nodes.push_back(empty_node());
        out_.depth = 1;
        if (bvh_.root == kNone) return std::move(out_);
        make_plans();
        struct Task {
            uint32_t wide, binary, depth;
        };
        std::vector<Task> tasks = {{0, bvh_.root, 1}};
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            out_.depth = std::max(out_.depth, task.depth);
            if (is_instance(task.binary)) {
                write_instance(task.wide, bvh_.nodes[task.binary].prim - scene_.primitive_count());
                continue;
            }
            const Slots slots = assign_slots(bounds(task.binary), children_of(*this, task.binary));
            const uint32_t first_child = write_node(task.wide, slots);
            uint32_t next = first_child;
            const size_t first_task = tasks.size();
            for (uint32_t slot = 0; slot < kWidth; ++slot)
                if (slots.node[slot] != kNone && !how(slots.node[slot]).is_leaf())
                    tasks.push_back({next++, slots.node[slot], task.depth + 1});
            std::reverse(tasks.begin() + int64_t(first_task), tasks.end());
        }
        if (out_.depth > uint32_t(kCwbvhStackSize))
            throw Error(ExitCode::device, "wide BVH: depth " + std::to_string(out_.depth) +
                                              " exceeds the traversal stack of " + std::to_string(kCwbvhStackSize));
        return std::move(out_);
    }

    // What collapse.h asks of a tree.
    How how(uint32_t node) const { return plans_[node].how; }
    uint32_t left(uint32_t node) const { return bvh_.nodes[node].left; }
    uint32_t right(uint32_t node) const { return bvh_.nodes[node].right; }
    const Bounds3f& bounds(uint32_t node) const { return bvh_.nodes[node].bounds; }

private:
    bool is_instance(uint32_t binary) const {
        return bvh_.nodes[binary].is_leaf() && scene_.is_instanced(bvh_.nodes[binary].prim);
    }

    void write_instance(uint32_t wide, uint32_t index) {
        const Instance& instance = scene_.instances[index];
        CwbvhInstance node = {};
        node.root = instance.group + 1;
        node.id_offset = instance.first_id - instance.first_triangle;
        node.to_group = instance.to_group;
        std::memcpy(static_cast<void*>(&out_.nodes[wide]), &node, sizeof node);
    }

    /// From the leaves up.
    void make_plans() {
        std::vector<uint32_t> order = {bvh_.root};
        for (size_t i = 0; i < order.size(); ++i) {
            const Bvh2Node& n = bvh_.nodes[order[i]];
            if (!n.is_leaf()) order.push_back(n.left), order.push_back(n.right);
        }
        for (size_t i = order.size(); i-- > 0;) {
            const Bvh2Node& n = bvh_.nodes[order[i]];
            const float area = n.bounds.half_area();
            plans_[order[i]] = !n.is_leaf()            ? inner_plan(plans_[n.left], plans_[n.right], area)
                               : is_instance(order[i]) ? instance_plan(area)
                                                       : primitive_plan(area);
        }
    }

    /// The assignment that maximises the sum of gains.
    Slots assign_slots(const Bounds3f& node, const Children& children) const {
        float gain[kWidth][kWidth];
        for (uint32_t c = 0; c < children.count; ++c)
            for (uint32_t s = 0; s < kWidth; ++s) gain[c][s] = slot_gain(off_middle(bounds(children.node[c]), node), s);
        // best[mask]: children 0..popcount(mask)-1 in the slots of mask.
        std::array<float, 256> best;
        std::array<uint8_t, 256> last;
        best.fill(-kInfinity);
        last.fill(0);
        best[0] = 0.0f;
        uint32_t final_mask = 0;
        for (uint32_t mask = 0; mask < 256; ++mask) {
            const uint32_t c = uint32_t(detail::count_bits(mask));
            if (c > children.count || (mask && best[mask] == -kInfinity)) continue;
            if (c == children.count) {
                if (!final_mask || best[mask] > best[final_mask]) final_mask = mask;
                continue;
            }
            for (uint32_t s = 0; s < kWidth; ++s) {
                const uint32_t next = mask | 1u << s;
                if (next == mask) continue;
                const float g = best[mask] + gain[c][s];
                if (best[next] == -kInfinity || g > best[next]) best[next] = g, last[next] = uint8_t(s);
            }
        }
        Slots slots = no_children();
        uint32_t mask = final_mask;
        for (uint32_t c = children.count; c-- > 0;) {
            slots.node[last[mask]] = children.node[c];
            mask &= ~(1u << last[mask]);
        }
        return slots;
    }

    void collect(uint32_t node, std::vector<uint32_t>& prims) const {
        const Bvh2Node& n = bvh_.nodes[node];
        if (n.is_leaf()) {
            // Parts of one triangle may meet again in a leaf.
            if (std::find(prims.begin(), prims.end(), n.prim) == prims.end()) prims.push_back(n.prim);
            return;
        }
        collect(n.left, prims);
        collect(n.right, prims);
    }

    uint32_t write_node(uint32_t wide, const Slots& slots) {
        CwbvhNode node = node_of_boxes(*this, slots);
        node.first_primitive = uint32_t(out_.primitives.size());
        node.first_child = uint32_t(out_.nodes.size());
        uint32_t inner_count = 0;
        for (uint32_t slot = 0; slot < kWidth; ++slot) {
            const uint32_t child = slots.node[slot];
            if (child == kNone) continue;
            if (how(child).is_leaf()) {
                std::vector<uint32_t> prims;
                collect(child, prims);
                node.valid |= leaf_bits(slot, uint32_t(prims.size()));
                for (const uint32_t prim : prims) out_.primitives.push_back(make_cwbvh_primitive(scene_, prim));
            } else {
                node.valid |= inner_bit(slot);
                ++inner_count;
            }
        }
        out_.nodes.resize(out_.nodes.size() + inner_count);
        out_.nodes[wide] = node;
        return node.first_child;
    }

    const SceneView& scene_;
    const Bvh2& bvh_;
    std::vector<Plan> plans_;
    CwbvhArrays out_;
};

}  // namespace

CwbvhArrays collapse_bvh2(const SceneView& scene, const Bvh2& bvh) { return Collapser(scene, bvh).run(); }

CwbvhArrays build_cwbvh(const SceneView& scene) {
    CwbvhArrays all = collapse_bvh2(scene, build_optimised_bvh2(scene));
    const size_t above = all.nodes.size();
    std::vector<uint32_t> roots;
    uint32_t deepest = 0;
    for (uint32_t g = 0; g < scene.group_count; ++g) {
        CwbvhArrays part = collapse_bvh2(scene, build_optimised_bvh2(scene, &scene.groups[g]));
        const uint32_t nodes = uint32_t(all.nodes.size()), primitives = uint32_t(all.primitives.size());
        for (CwbvhNode& node : part.nodes)
            if (node.valid) node.first_child += nodes, node.first_primitive += primitives;
        roots.push_back(nodes);
        deepest = std::max(deepest, part.depth);
        all.nodes.insert(all.nodes.end(), part.nodes.begin(), part.nodes.end());
        all.primitives.insert(all.primitives.end(), part.primitives.begin(), part.primitives.end());
    }
    for (size_t i = 0; i < above; ++i)
        if (is_instance(all.nodes[i])) all.nodes[i].first_child = roots[all.nodes[i].first_child - 1];
    all.depth += deepest;
    if (all.depth > uint32_t(kCwbvhStackSize))
        throw Error(ExitCode::device, "wide BVH: a depth of " + std::to_string(all.depth) +
                                          " in two levels exceeds the traversal stack of " +
                                          std::to_string(kCwbvhStackSize));
    return all;
}

CwbvhAccel::CwbvhAccel(const Scene& scene) {
    const auto start = std::chrono::steady_clock::now();
    arrays_ = build_cwbvh(scene.view());
    build_seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace ambilux
