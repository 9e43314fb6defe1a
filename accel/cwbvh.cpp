#include "accel/cwbvh.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <string>

#include "accel/bvh2.h"
#include "core/error.h"
#include "scene/scene.h"

namespace ambilux {

namespace {

constexpr uint32_t kWidth = 8;
constexpr uint32_t kMaxLeafSize = 3;
/// Cost of testing a node's children and one primitive (Ylitie et al. 2017, section 5.1).
constexpr float kNodeCost = 1.0f, kPrimitiveCost = 0.3f;
/// And of going into an instance.
constexpr float kInstanceCost = 6.0f;

/// Best cost of representing a binary subtree by at most i+1 wide nodes or leaves, and how.
struct Plan {
    float cost[kWidth - 1];
    uint8_t left_share[kWidth];  ///< for i+1 children: how many the left subtree gets; 0 means "as with i children"
    uint8_t primitives;          ///< in the subtree, at most kMaxLeafSize + 1
    bool leaf;                   ///< a single child is best made a leaf
};

/// Children of a wide node as binary nodes, and whether they become leaves.
struct Children {
    uint32_t node[kWidth];
    uint32_t count = 0;
};

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
            Children children;
            if (plans_[task.binary].leaf)
                children.node[children.count++] = task.binary;  // the root of a tiny scene
            else
                gather(task.binary, kWidth, children);
            std::array<uint32_t, kWidth> slots = assign_slots(bvh_.nodes[task.binary].bounds, children);
            const uint32_t first_child = write_node(task.wide, slots);
            uint32_t next = first_child;
            const size_t first_task = tasks.size();
            for (uint32_t slot = 0; slot < kWidth; ++slot)
                if (slots[slot] != kNone && !plans_[slots[slot]].leaf)
                    tasks.push_back({next++, slots[slot], task.depth + 1});
            std::reverse(tasks.begin() + int64_t(first_task), tasks.end());
        }
        if (out_.depth > uint32_t(kCwbvhStackSize))
            throw Error(ExitCode::device, "wide BVH: depth " + std::to_string(out_.depth) +
                                              " exceeds the traversal stack of " + std::to_string(kCwbvhStackSize));
        return std::move(out_);
    }

private:
    static CwbvhNode empty_node() {
        CwbvhNode n = {};
        n.scale_xz = 0x3f803f80u, n.scale_y = 1.0f;
        return n;
    }

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

    /// Dynamic programming from the leaves up (equations 1-5 of the paper).
    void make_plans() {
        std::vector<uint32_t> order = {bvh_.root};
        for (size_t i = 0; i < order.size(); ++i) {
            const Bvh2Node& n = bvh_.nodes[order[i]];
            if (!n.is_leaf()) order.push_back(n.left), order.push_back(n.right);
        }
        for (size_t i = order.size(); i-- > 0;) {
            const Bvh2Node& n = bvh_.nodes[order[i]];
            Plan& plan = plans_[order[i]];
            const float area = n.bounds.half_area();
            if (n.is_leaf() && is_instance(order[i])) {
                plan.primitives = kMaxLeafSize + 1;  // never part of a leaf
                plan.leaf = false;
                for (float& c : plan.cost) c = area * kInstanceCost;
                for (uint8_t& s : plan.left_share) s = 0;
                continue;
            }
            if (n.is_leaf()) {
                plan.primitives = 1;
                plan.leaf = true;
                for (float& c : plan.cost) c = area * kPrimitiveCost;
                for (uint8_t& s : plan.left_share) s = 0;
                continue;
            }
            const Plan &left = plans_[n.left], &right = plans_[n.right];
            plan.primitives = uint8_t(std::min<uint32_t>(left.primitives + right.primitives, kMaxLeafSize + 1));
            float distribute[kWidth];
            plan.left_share[0] = 0;
            for (uint32_t count = 2; count <= kWidth; ++count) {
                float best = kInfinity;
                plan.left_share[count - 1] = 1;
                for (uint32_t k = 1; k < count; ++k) {
                    const float c = left.cost[k - 1] + right.cost[count - k - 1];
                    if (c < best) best = c, plan.left_share[count - 1] = uint8_t(k);
                }
                distribute[count - 1] = best;
            }
            const float inner = distribute[kWidth - 1] + area * kNodeCost;
            const float leaf = plan.primitives <= kMaxLeafSize ? area * kPrimitiveCost * plan.primitives : kInfinity;
            plan.leaf = plan.primitives <= kMaxLeafSize && leaf <= inner;
            plan.cost[0] = std::min(leaf, inner);
            for (uint32_t count = 2; count < kWidth; ++count) {
                plan.cost[count - 1] = distribute[count - 1];
                if (!(distribute[count - 1] < plan.cost[count - 2])) {
                    plan.cost[count - 1] = plan.cost[count - 2];
                    plan.left_share[count - 1] = 0;
                }
            }
        }
    }

    void gather(uint32_t node, uint32_t count, Children& out) const {
        while (count > 1 && plans_[node].left_share[count - 1] == 0) --count;
        if (count == 1) {
            out.node[out.count++] = node;
            return;
        }
        const uint32_t k = plans_[node].left_share[count - 1];
        gather(bvh_.nodes[node].left, k, out);
        gather(bvh_.nodes[node].right, count - k, out);
    }

    /// Slot s belongs to the corner whose bit k says "upper side of axis k"; the assignment maximises the sum of
    /// projections on those diagonals.
    std::array<uint32_t, kWidth> assign_slots(const Bounds3f& bounds, const Children& children) const {
        float gain[kWidth][kWidth];
        for (uint32_t c = 0; c < children.count; ++c) {
            const Bounds3f& b = bvh_.nodes[children.node[c]].bounds;
            const Vec3f d = (b.lower - bounds.lower) + (b.upper - bounds.upper);
            for (uint32_t s = 0; s < kWidth; ++s)
                gain[c][s] = (s & 1 ? d.x : -d.x) + (s & 2 ? d.y : -d.y) + (s & 4 ? d.z : -d.z);
        }
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
        std::array<uint32_t, kWidth> slots;
        slots.fill(kNone);
        uint32_t mask = final_mask;
        for (uint32_t c = children.count; c-- > 0;) {
            slots[last[mask]] = children.node[c];
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

    /// Exponent of the quantisation step for children in [lower, upper], and the corner they are counted from.
    static int choose_grid(float lower, float upper, float& corner) {
        const double extent = double(upper) - double(lower);
        // Not finer than what floats at these coordinates can tell apart.
        const double least = std::max(std::max(std::fabs(double(lower)), std::fabs(double(upper))) * 0x1p-21, 0x1p-90);
        int e = int(std::ceil(std::log2(std::max(extent / 254.5, least))));
        for (;; ++e) {
            const double step = std::ldexp(1.0, e);
            corner = next_float_down(float(double(lower) - 0.0625 * step));
            if (std::ceil((double(upper) - double(corner)) / step + kCwbvhMargin) <= 255.0) break;
        }
        return std::clamp(e, -126 - 15, 127 - 15);
    }

    uint32_t write_node(uint32_t wide, const std::array<uint32_t, kWidth>& slots) {
        CwbvhNode node = empty_node();
        Bounds3f bounds;
        for (const uint32_t s : slots)
            if (s != kNone) bounds.extend(bvh_.nodes[s].bounds);
        double step[3];
        float scale[3];
        for (int axis = 0; axis < 3; ++axis) {
            const int exponent = choose_grid(bounds.lower[axis], bounds.upper[axis], node.p[axis]);
            step[axis] = std::ldexp(1.0, exponent);
            scale[axis] = std::ldexp(1.0f, exponent + 15);
        }
        node.scale_xz = float_bits(scale[0]) | float_bits(scale[2]) >> 16;
        node.scale_y = scale[1];
        node.first_primitive = uint32_t(out_.primitives.size());
        node.first_child = uint32_t(out_.nodes.size());
        uint32_t inner_count = 0;
        uint8_t lower[3][kWidth] = {}, upper[3][kWidth] = {};
        for (uint32_t slot = 0; slot < kWidth; ++slot) {
            if (slots[slot] == kNone) continue;
            if (plans_[slots[slot]].leaf) {
                std::vector<uint32_t> prims;
                collect(slots[slot], prims);
                node.valid |= ((1u << prims.size()) - 1) << (3 * slot);
                for (const uint32_t prim : prims) out_.primitives.push_back(make_cwbvh_primitive(scene_, prim));
            } else {
                node.valid |= 1u << (24 + slot);
                ++inner_count;
            }
            const Bounds3f& b = bvh_.nodes[slots[slot]].bounds;
            for (int axis = 0; axis < 3; ++axis) {
                // Clamped, never wrapped: choose_grid leaves room for all of them.
                const double lo =
                    std::floor((double(b.lower[axis]) - double(node.p[axis])) / step[axis] - kCwbvhMargin);
                const double hi = std::ceil((double(b.upper[axis]) - double(node.p[axis])) / step[axis] + kCwbvhMargin);
                lower[axis][slot] = uint8_t(std::clamp(lo, 0.0, 255.0));
                upper[axis][slot] = uint8_t(std::clamp(hi, 0.0, 255.0));
            }
        }
        std::memcpy(node.lower_x, lower[0], kWidth), std::memcpy(node.lower_y, lower[1], kWidth),
            std::memcpy(node.lower_z, lower[2], kWidth);
        std::memcpy(node.upper_x, upper[0], kWidth), std::memcpy(node.upper_y, upper[1], kWidth),
            std::memcpy(node.upper_z, upper[2], kWidth);
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

CwbvhPrimitive make_cwbvh_primitive(const SceneView& scene, uint32_t prim) {
    CwbvhPrimitive p = {};
    p.word = prim | (material_of(scene, prim).lets_pass() ? CwbvhPrimitive::kLetsPass : 0);
    if (scene.is_triangle(prim)) {
        const Triangle t = scene.triangles[prim];
        p.v0 = scene.vertices[t.v0].p, p.v1 = scene.vertices[t.v1].p, p.v2 = scene.vertices[t.v2].p;
        const Vec3f normal = detail::accurate_cross(p.v1 - p.v0, p.v2 - p.v0);
        p.normal_x = normal.x, p.normal_y = normal.y;
    }
    return p;
}

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
