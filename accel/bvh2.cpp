#include "accel/bvh2.h"

#include <algorithm>
#include <string>

#include "accel/embree_api.h"
#include "core/error.h"
#include "core/parallel.h"

namespace ambilux {

void split_triangle_bounds(const SceneView& scene, uint32_t prim, const Bounds3f& within, int axis, float position,
                           Bounds3f& left, Bounds3f& right) {
    const Triangle tri = scene.triangles[prim];
    const Vec3f v[3] = {scene.vertices[tri.v0].p, scene.vertices[tri.v1].p, scene.vertices[tri.v2].p};
    left = right = {};
    for (int i = 0; i < 3; ++i) {
        const Vec3f a = v[i], b = v[(i + 1) % 3];
        if (a[axis] <= position) left.extend(a);
        if (a[axis] >= position) right.extend(a);
        if ((a[axis] < position && b[axis] > position) || (a[axis] > position && b[axis] < position)) {
            const Vec3f c = a + (b - a) * ((position - a[axis]) / (b[axis] - a[axis]));
            const Vec3f pad = max(abs(a), abs(b)) * gamma_bound(6);
            left.extend(c - pad), left.extend(c + pad);
            right.extend(c - pad), right.extend(c + pad);
        }
    }
    left.upper[axis] = min(left.upper[axis], position);
    right.lower[axis] = max(right.lower[axis], position);
    left.lower = max(left.lower, within.lower), left.upper = min(left.upper, within.upper);
    right.lower = max(right.lower, within.lower), right.upper = min(right.upper, within.upper);
}

namespace {

/// Node as Embree's builder makes it.
struct BuildNode {
    BuildNode* children[2];  ///< null in leaves
    Bounds3f bounds;         ///< of leaves
    uint32_t prim;
};

struct BuildInput {
    const SceneView& scene;
};

Bounds3f bounds_of(const RTCBuildPrimitive& p) {
    return {{p.lower_x, p.lower_y, p.lower_z}, {p.upper_x, p.upper_y, p.upper_z}};
}

void store(const Bounds3f& b, RTCBounds& out) {
    out.lower_x = b.lower.x, out.lower_y = b.lower.y, out.lower_z = b.lower.z;
    out.upper_x = b.upper.x, out.upper_y = b.upper.y, out.upper_z = b.upper.z;
}

void* create_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
    return new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), alignof(BuildNode)))
        BuildNode{{nullptr, nullptr}, {}, kNone};
}

void set_children(void* node, void** children, unsigned count, void*) {
    for (unsigned i = 0; i < count && i < 2; ++i)
        static_cast<BuildNode*>(node)->children[i] = static_cast<BuildNode*>(children[i]);
}

void ignore_bounds(void*, const RTCBounds**, unsigned, void*) {}  // recomputed from the leaves

void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives, size_t, void*) {
    return new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), alignof(BuildNode)))
        BuildNode{{nullptr, nullptr}, bounds_of(primitives[0]), primitives[0].primID};
}

void split_primitive(const RTCBuildPrimitive* primitive, unsigned axis, float position, RTCBounds* left_out,
                     RTCBounds* right_out, void* user) {
    const SceneView& scene = static_cast<BuildInput*>(user)->scene;
    const Bounds3f within = bounds_of(*primitive);
    Bounds3f left = within, right = within;
    if (scene.is_triangle(primitive->primID)) {
        split_triangle_bounds(scene, primitive->primID, within, int(axis), position, left, right);
        // A sliver that rounding leaves without a box on one side: cut the box alone.
        if (left.empty()) left = within, left.upper[int(axis)] = min(position, within.upper[int(axis)]);
        if (right.empty()) right = within, right.lower[int(axis)] = max(position, within.lower[int(axis)]);
    } else {
        left.upper[int(axis)] = min(position, within.upper[int(axis)]);
        right.lower[int(axis)] = max(position, within.lower[int(axis)]);
    }
    store(left, *left_out);
    store(right, *right_out);
}

/// Copies Embree's nodes in depth-first order, left before right, so that the result does not depend on which thread
/// made what.
uint32_t flatten(const BuildNode* root, Bvh2& out) {
    struct Task {
        const BuildNode* node;
        uint32_t index;
        bool done;
    };
    std::vector<Task> tasks;
    const auto add = [&](const BuildNode* node) {
        const uint32_t index = uint32_t(out.nodes.size());
        out.nodes.push_back({node->bounds, kNone, kNone, node->prim});
        tasks.push_back({node, index, false});
        return index;
    };
    const uint32_t first = add(root);
    while (!tasks.empty()) {
        Task& task = tasks.back();
        const BuildNode* node = task.node;
        const uint32_t index = task.index;
        if (!node->children[0]) {
            tasks.pop_back();
        } else if (task.done) {
            Bounds3f b = out.nodes[out.nodes[index].left].bounds;
            b.extend(out.nodes[out.nodes[index].right].bounds);
            out.nodes[index].bounds = b;
            tasks.pop_back();
        } else {
            task.done = true;
            const uint32_t right = add(node->children[1]);
            const uint32_t left = add(node->children[0]);
            out.nodes[index].left = left;
            out.nodes[index].right = right;
        }
    }
    return first;
}

/// Boxes of what a tree holds; `group`: of its triangles alone. What has no extent or no finite vertices is left out.
std::vector<RTCBuildPrimitive> primitives_of(const SceneView& scene, const Group* group) {
    std::vector<RTCBuildPrimitive> primitives;
    const uint32_t first = group ? group->first_triangle : 0,
                   count = group ? first + group->triangle_count : scene.primitive_count() + scene.instance_count;
    primitives.reserve(size_t(count - first) * 2);
    for (uint32_t i = first; i < count; ++i) {
        if (!group && scene.group_count && i >= scene.ungrouped_count() && i < scene.triangle_count) continue;
        const Bounds3f b = scene.is_instanced(i) ? instance_bounds(scene, scene.instances[i - scene.primitive_count()])
                                                 : finite_bounds(scene, i);
        if (b.empty() || !is_finite(b.lower) || !is_finite(b.upper)) continue;
        RTCBuildPrimitive p;
        p.lower_x = b.lower.x, p.lower_y = b.lower.y, p.lower_z = b.lower.z, p.geomID = 0;
        p.upper_x = b.upper.x, p.upper_y = b.upper.y, p.upper_z = b.upper.z, p.primID = i;
        primitives.push_back(p);
    }
    return primitives;
}

}  // namespace

Bvh2 build_bvh2(const SceneView& scene, const Group* group) {
    Bvh2 out;
    std::vector<RTCBuildPrimitive> primitives = primitives_of(scene, group);
    if (primitives.empty()) return out;

    const size_t used = primitives.size();
    primitives.resize(used * 2);  // room for what splits add
    RTCDevice device = rtcNewDevice(nullptr);
    if (!device) throw Error(ExitCode::device, "Embree: making a device failed");
    RTCBVH bvh = rtcNewBVH(device);
    BuildInput input{scene};
    RTCBuildArguments args = rtcDefaultBuildArguments();
    const bool instances = !group && scene.instance_count > 0;
    args.buildQuality = instances ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH;
    args.maxBranchingFactor = 2;
    args.maxDepth = 64;
    args.sahBlockSize = 1;
    args.minLeafSize = 1;
    args.maxLeafSize = 1;
    args.traversalCost = 1.0f;
    args.intersectionCost = 1.0f;
    args.bvh = bvh;
    args.primitives = primitives.data();
    args.primitiveCount = used;
    args.primitiveArrayCapacity = primitives.size();
    args.createNode = create_node;
    args.setNodeChildren = set_children;
    args.setNodeBounds = ignore_bounds;
    args.createLeaf = create_leaf;
    args.splitPrimitive = split_primitive;
    args.userPtr = &input;
    const auto* root = static_cast<const BuildNode*>(rtcBuildBVH(&args));
    const RTCError error = rtcGetDeviceError(device);
    if (root) out.root = flatten(root, out);
    rtcReleaseBVH(bvh);
    rtcReleaseDevice(device);
    if (!root || error != RTC_ERROR_NONE)
        throw Error(ExitCode::device,
                    "Embree: building a binary tree failed with error code " + std::to_string(int(error)));
    return out;
}

namespace {

/// Reinsertion of subtrees (Meister and Bittner 2018, "Parallel Reinsertion for Bounding Volume Hierarchy
/// Optimization").
class Reinserter {
public:
    explicit Reinserter(Bvh2& bvh)
        : bvh_(bvh), nodes_(bvh.nodes), parent_(nodes_.size(), kNone), area_(nodes_.size()),
          touched_(nodes_.size(), 0) {
        for (uint32_t i = 0; i < nodes_.size(); ++i) {
            area_[i] = nodes_[i].bounds.half_area();
            if (!nodes_[i].is_leaf()) parent_[nodes_[i].left] = parent_[nodes_[i].right] = i;
        }
    }

    /// Moves those of the `share` largest nodes that gain by it; returns by how much the sum of areas of inner nodes
    /// falls.
    double pass(float share) {
        std::vector<uint32_t> candidates;
        for (uint32_t i = 0; i < nodes_.size(); ++i)
            if (i != bvh_.root && parent_[i] != bvh_.root && parent_[i] != kNone) candidates.push_back(i);
        const size_t count = std::min(candidates.size(), size_t(double(candidates.size()) * share) + 1);
        const auto larger = [&](uint32_t a, uint32_t b) {
            return area_[a] > area_[b] || (area_[a] == area_[b] && a < b);
        };
        if (count < candidates.size())
            std::nth_element(candidates.begin(), candidates.begin() + int64_t(count), candidates.end(), larger);
        candidates.resize(count);
        std::vector<Move> moves(count);
        parallel_for(count, [&](size_t i) { moves[i] = find_move(candidates[i]); }, size_t(64));
        std::erase_if(moves, [](const Move& m) { return m.gain <= 0.0f; });
        std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) {
            return a.gain > b.gain || (a.gain == b.gain && a.node < b.node);
        });

        // Moves were found in the tree as it was: those that touch a node of one already made have to wait for the next
        // pass.
        std::fill(touched_.begin(), touched_.end(), uint8_t(0));
        double gain = 0.0;
        for (const Move& m : moves) {
            const uint32_t nodes[5] = {m.node, m.target, sibling(m.node), parent_[m.node], parent_[m.target]};
            bool free = true;
            for (const uint32_t n : nodes) free = free && !touched_[n];
            if (!free) continue;
            for (const uint32_t n : nodes) touched_[n] = 1;
            make_move(m);
            gain += m.gain;
        }
        return gain;
    }

private:
    struct Move {
        uint32_t node, target;
        float gain = 0.0f;  ///< by which the sum of areas falls
    };

    uint32_t sibling(uint32_t node) const {
        const Bvh2Node& p = nodes_[parent_[node]];
        return p.left == node ? p.right : p.left;
    }

    static float joint_area(const Bounds3f& a, const Bounds3f& b) {
        const Vec3f e = max(a.upper, b.upper) - min(a.lower, b.lower);
        return e.x * e.y + e.y * e.z + e.z * e.x;
    }

    /// Best place for the subtree of `node`: branch and bound over the siblings on its way to the root (section 3.1).
    Move find_move(uint32_t node) const {
        struct Entry {
            float saved;  ///< if the subtree goes below here: what removing it saves less what its ancestors grow by
            uint32_t index;
        };
        Entry stack[256];
        const Bounds3f bounds = nodes_[node].bounds;
        const float area = area_[node];
        Move best = {node, kNone, 0.0f};
        uint32_t pivot = parent_[node], start = sibling(node);
        float saved = area_[pivot];
        Bounds3f without = nodes_[start].bounds;  // of the pivot, once the subtree is gone
        for (;;) {
            int top = 0;
            stack[top++] = {saved, start};
            while (top > 0) {
                const Entry e = stack[--top];
                if (e.saved - area <= best.gain) continue;
                const float joint = joint_area(nodes_[e.index].bounds, bounds);
                const float gain = e.saved - joint;
                if (gain > best.gain && e.index != sibling(node)) best.gain = gain, best.target = e.index;
                const Bvh2Node& n = nodes_[e.index];
                const float below = gain + area_[e.index];
                if (n.is_leaf() || below - area <= best.gain || top + 2 > 256) continue;
                // The child that grows less is looked at first.
                const float left = joint_area(nodes_[n.left].bounds, bounds) - area_[n.left],
                            right = joint_area(nodes_[n.right].bounds, bounds) - area_[n.right];
                stack[top++] = {below, left < right ? n.right : n.left};
                stack[top++] = {below, left < right ? n.left : n.right};
            }
            if (pivot == bvh_.root) break;
            if (pivot != parent_[node]) {
                without.extend(nodes_[start].bounds);
                saved += area_[pivot] - without.half_area();
            }
            start = sibling(pivot);
            pivot = parent_[pivot];
        }
        return best;
    }

    void make_move(const Move& m) {
        const uint32_t parent = parent_[m.node], other = sibling(m.node), grandparent = parent_[parent];
        replace_child(grandparent, parent, other);
        const uint32_t above = parent_[m.target];
        replace_child(above, m.target, parent);
        nodes_[parent].left = m.node, nodes_[parent].right = m.target;
        parent_[m.target] = parent;
        refit(grandparent);
        refit(parent);
    }

    void replace_child(uint32_t node, uint32_t before, uint32_t after) {
        (nodes_[node].left == before ? nodes_[node].left : nodes_[node].right) = after;
        parent_[after] = node;
    }

    void refit(uint32_t node) {
        for (; node != kNone; node = parent_[node]) {
            Bounds3f b = nodes_[nodes_[node].left].bounds;
            b.extend(nodes_[nodes_[node].right].bounds);
            nodes_[node].bounds = b;
            area_[node] = b.half_area();
        }
    }

    Bvh2& bvh_;
    std::vector<Bvh2Node>& nodes_;
    std::vector<uint32_t> parent_;
    std::vector<float> area_;
    std::vector<uint8_t> touched_;
};

}  // namespace

void optimise_bvh2(Bvh2& bvh, int passes) {
    if (bvh.root == kNone) return;
    // The largest tenth of the nodes gives 0.99 of what all of them do.
    constexpr float kShare = 0.1f;
    Reinserter reinserter(bvh);
    for (int i = 0; i < passes; ++i)
        if (reinserter.pass(kShare) == 0.0) break;
}

uint32_t bvh2_depth(const Bvh2& bvh) {
    struct Task {
        uint32_t node, depth;
    };
    uint32_t deepest = 0;
    std::vector<Task> tasks;
    if (bvh.root != kNone) tasks.push_back({bvh.root, 1});
    while (!tasks.empty()) {
        const Task task = tasks.back();
        tasks.pop_back();
        deepest = std::max(deepest, task.depth);
        const Bvh2Node& n = bvh.nodes[task.node];
        if (n.is_leaf()) continue;
        tasks.push_back({n.left, task.depth + 1});
        tasks.push_back({n.right, task.depth + 1});
    }
    return deepest;
}

Bvh2 build_optimised_bvh2(const SceneView& scene, const Group* group) {
    Bvh2 bvh = build_bvh2(scene, group);
    optimise_bvh2(bvh, kReinsertionPasses);
    return bvh2_depth(bvh) > kMostBvh2Depth ? build_bvh2(scene, group) : bvh;
}

double bvh2_cost(const Bvh2& bvh) {
    if (bvh.root == kNone) return 0.0;
    double sum = 0.0;
    // Walk, since optimisation may leave unused nodes.
    std::vector<uint32_t> stack = {bvh.root};
    while (!stack.empty()) {
        const Bvh2Node& n = bvh.nodes[stack.back()];
        stack.pop_back();
        if (n.is_leaf()) continue;
        sum += n.bounds.half_area();
        stack.push_back(n.left);
        stack.push_back(n.right);
    }
    const double root = bvh.nodes[bvh.root].bounds.half_area();
    return root > 0.0 ? sum / root : 0.0;
}

}  // namespace ambilux
