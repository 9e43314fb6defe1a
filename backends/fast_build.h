// A wide BVH in a small part of the time that the good one takes (accel/cwbvh.h), by data-parallel steps that a host
// and a device run alike, to the same bits.
#pragma once

#include <vector>

#include "accel/fast/wide.h"
#include "queues/layout.h"
#include "queues/primitives.h"

namespace ambilux {

/// Memory of a build, of which parts serve several steps one after the other.
struct FastBuildMemory {
    static constexpr uint32_t kBoxes[3] = {1u << 14, 1u << 7, 1};  ///< what the box over all is joined from

    fast::Node* nodes;
    collapse::Plan* plans;
    fast::Reference* references;  ///< where plans are later
    Bounds3f* boxes[3];
    ScanMemory scan;
    // One after the other in the same place:
    uint32_t* counts;
    SortMemory<uint64_t> sort;
    uint32_t *clusters[2], *partner, *stays;
    fast::Node* top_nodes;
    collapse::Plan* top_plans;
    fast::WideNodes wide;
    uint32_t *inner, *primitives;  ///< of a level

    /// For `primitives` of a scene.
    [[gnu::cold]] static FastBuildMemory lay_out(Layout& layout, uint32_t primitives, const PrimitiveBytes& bytes);
};

/// Clusters from which on the tree is improved on the host.
constexpr uint32_t kTopClusters = 1u << 14;

/// The nodes above them.
struct FastTop {
    uint32_t first = 0;                 ///< node
    std::vector<uint32_t> clusters;     ///< as nodes
    std::vector<fast::Node> nodes;      ///< of the clusters
    std::vector<collapse::Plan> plans;  ///< of the clusters; improve() makes those of the nodes above of them
    std::vector<fast::Node> joins;      ///< from `first` on, each behind its children
};
void improve(FastTop& top);

/// What a build has found, which write_fast_build needs.
struct FastBuild {
    fast::Tree tree;
    uint32_t nodes = 0, primitives = 0, depth = 0;  ///< of the wide tree
};

/// Bytes that a build needs, those of the structure included, unless its nodes have very few children.
uint64_t fast_build_peak_bytes(uint32_t primitives, const PrimitiveBytes& bytes);
/// Throws Error(usage) of a scene with groups, whose tree has two levels.
void check_no_groups(const SceneView& scene);
/// Throws Error(device) if the tree is deeper than the traversal stack.
void check_depth(const FastBuild& build);

namespace detail {

/// Returns how many leaves there are.
template <class Exec>
uint32_t make_leaves(Exec& exec, const SceneView& scene, const FastBuildMemory& m) {
    const uint32_t primitives = scene.primitive_count();
    exec.for_each(fast::CountReferences{scene, primitives, m.counts}, primitives + 1);
    exec.scan(m.scan, m.counts, m.counts, primitives + 1);
    exec.for_each(fast::MakeReferences{scene, m.counts, m.references}, primitives);
    const uint32_t count = exec.download(m.counts + primitives, 1)[0];
    const auto& parts = FastBuildMemory::kBoxes;
    exec.for_each(fast::JoinBounds<fast::Reference>{m.references, count, parts[0], m.boxes[0]}, parts[0]);
    for (int i = 1; i < 3; ++i)
        exec.for_each(fast::JoinBounds<Bounds3f>{m.boxes[i - 1], parts[i - 1], parts[i], m.boxes[i]}, parts[i]);
    exec.for_each(fast::MakeCodes{m.references, m.boxes[2], m.sort.keys[0], m.sort.values[0]}, count);
    exec.sort_pairs(m.sort, count, 3 * fast::kGridBits);
    exec.for_each(fast::MakeLeaves{m.references, m.sort.values[1], m.nodes}, count);
    return count;
}

/// Joins all leaves in rounds; the root is the last node. Returns the top: from so many clusters on, where each lies.
template <class Exec>
FastTop join_leaves(Exec& exec, const FastBuildMemory& m, uint32_t leaves) {
    exec.for_each(fast::FirstClusters{m.clusters[0]}, leaves);
    uint32_t next = leaves;
    bool slow = false;
    FastTop top;
    for (uint32_t count = leaves, from = 0; count > 1; from ^= 1) {
        if (top.clusters.empty() && count <= kTopClusters) {
            top.first = next;
            top.clusters = exec.download(m.clusters[from], count);
        }
        if (slow)
            exec.for_each(fast::PairUp{count, m.partner}, count);
        else
            exec.for_each(fast::FindPartner{m.nodes, m.clusters[from], count, m.partner}, count);
        exec.for_each(fast::MarkStaying{m.partner, count, m.stays}, count + 1);
        exec.scan(m.scan, m.stays, m.stays, count + 1);
        exec.for_each(
            fast::JoinPairs{m.partner, m.stays, m.clusters[from], m.clusters[from ^ 1], m.nodes, m.plans, leaves, next},
            count);
        const uint32_t left = exec.download(m.stays + count, 1)[0];
        next += count - left;
        slow = count - left < count / 16;
        count = left;
    }
    return top;
}

/// Takes subtrees of the top out and puts them where they cost less: that is where rays pass most, and rounds are
/// short of choices.
template <class Exec>
void improve_top(Exec& exec, const FastBuildMemory& m, uint32_t leaves, FastTop& top) {
    const uint32_t count = uint32_t(top.clusters.size());
    if (count < 3) return;
    // Through memory of rounds that are over.
    exec.for_each(fast::GatherClusters{m.nodes, m.plans, leaves, exec.upload(m.clusters[0], top.clusters), m.top_nodes,
                                       m.top_plans},
                  count);
    top.nodes = exec.download(m.top_nodes, count);
    top.plans = exec.download(m.top_plans, count);
    top.joins = exec.download(m.nodes + top.first, count - 1);
    improve(top);
    exec.upload(m.nodes + top.first, top.joins);
    exec.upload(m.plans + (top.first - leaves), top.plans);
}

template <class Exec>
void widen(Exec& exec, const FastBuildMemory& m, FastBuild& build) {
    exec.upload(m.wide.binary, std::vector<uint32_t>{2 * build.tree.leaves - 2});  // the root
    build.nodes = 1;
    for (uint32_t first = 0; first < build.nodes; ++build.depth) {
        const uint32_t count = build.nodes - first;
        exec.for_each(fast::CountChildren{build.tree, m.wide.binary + first, count, m.inner, m.primitives}, count + 1);
        exec.scan(m.scan, m.inner, m.inner, count + 1);
        exec.scan(m.scan, m.primitives, m.primitives, count + 1);
        exec.for_each(
            fast::PlaceChildren{build.tree, m.wide, first, build.nodes, build.primitives, m.inner, m.primitives},
            count);
        first = build.nodes;
        build.nodes += exec.download(m.inner + count, 1)[0];
        build.primitives += exec.download(m.primitives + count, 1)[0];
    }
}

}  // namespace detail

/// All but the nodes themselves, of a scene without groups. `Exec` runs functions over numbers, sorts, sums, and copies
/// arrays from and to its memory.
template <class Exec>
FastBuild plan_fast_build(Exec& exec, const SceneView& scene, const FastBuildMemory& m) {
    FastBuild build;
    build.tree = {m.nodes, m.plans, detail::make_leaves(exec, scene, m)};
    if (build.tree.leaves == 0) {
        build.nodes = build.depth = 1;
        return build;
    }
    FastTop top = detail::join_leaves(exec, m, build.tree.leaves);
    detail::improve_top(exec, m, build.tree.leaves, top);
    detail::widen(exec, m, build);
    return build;
}

/// Into `nodes` and `primitives`, as many as `build` says.
template <class Exec>
void write_fast_build(Exec& exec, const SceneView& scene, const FastBuildMemory& m, const FastBuild& build,
                      CwbvhNode* nodes, CwbvhPrimitive* primitives) {
    exec.for_each(fast::WriteNodes{scene, build.tree, m.wide, nodes, primitives}, build.nodes);
}

}  // namespace ambilux
