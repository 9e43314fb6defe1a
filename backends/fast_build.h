// A wide BVH in a hundredth of the time that the good one takes (accel/cwbvh.h), by data-parallel steps that a host and
// a device run alike, to the same bits.
#pragma once

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
    uint32_t room;  ///< for references
    // One after the other in the same place:
    uint32_t* counts;
    float* worth;
    SortMemory<uint64_t> sort;
    uint32_t *clusters[2], *partner, *stays;
    fast::WideNodes wide;
    uint32_t *inner, *primitives;  ///< of a level

    /// For `primitives` of a scene and at most `references`.
    [[gnu::cold]] static FastBuildMemory lay_out(Layout& layout, uint32_t primitives, uint32_t references,
                                                 const PrimitiveBytes& bytes);
};

/// What a build has found, which write_fast_build needs.
struct FastBuild {
    fast::Tree tree;
    uint32_t nodes = 0, primitives = 0, depth = 0;  ///< of the wide tree
};

/// References that there is room for.
inline uint32_t fast_references(uint32_t primitives) { return primitives + primitives / 4; }
/// Times the root of the number of primitives: the most splits per worth. Even triangles are worth less than one.
constexpr float kMostSplitsOfAll = 2.0f;
/// Bytes that a build needs for a while.
uint64_t fast_build_bytes(uint32_t primitives, const PrimitiveBytes& bytes);

namespace detail {

/// Box over all primitives, in the last of `boxes`.
template <class Exec>
void join_bounds(Exec& exec, const SceneView& scene, const FastBuildMemory& m) {
    const auto& parts = FastBuildMemory::kBoxes;
    exec.for_each(fast::JoinBounds<fast::PrimitiveBoxes>{{scene}, scene.primitive_count(), parts[0], m.boxes[0]},
                  parts[0]);
    for (int i = 1; i < 3; ++i)
        exec.for_each(fast::JoinBounds<const Bounds3f*>{m.boxes[i - 1], parts[i - 1], parts[i], m.boxes[i]}, parts[i]);
}

/// Where those of each primitive go, once triangles are split as often as there is room for.
template <class Exec>
uint32_t count_references(Exec& exec, const SceneView& scene, const FastBuildMemory& m) {
    const uint32_t primitives = scene.primitive_count();
    exec.for_each(fast::WeighSplits{scene, m.boxes[2], m.worth}, primitives);
    const auto count = [&](float splits) {
        exec.for_each(fast::CountReferences{m.worth, splits, primitives, m.counts}, primitives + 1);
        exec.scan(m.scan, m.counts, m.counts, primitives + 1);
        return exec.read(m.counts + primitives);
    };
    const float most = kMostSplitsOfAll * rounded_sqrt(float(primitives));
    float fits = 0.0f, step = 1.0f;
    while (fits + step < most && count(fits + step) <= m.room) fits += step, step = fits;
    for (int i = 0; i < 4; ++i, step *= 0.5f)
        if (fits + step < most && count(fits + step) <= m.room) fits += step;
    return count(fits);
}

/// Returns how many leaves there are.
template <class Exec>
uint32_t make_leaves(Exec& exec, const SceneView& scene, const FastBuildMemory& m) {
    join_bounds(exec, scene, m);
    const uint32_t count = count_references(exec, scene, m);
    exec.for_each(fast::MakeReferences{scene, m.boxes[2], m.counts, m.references}, scene.primitive_count());
    exec.for_each(fast::MakeCodes{m.references, m.boxes[2], m.sort.keys[0], m.sort.values[0]}, count);
    exec.sort_pairs(m.sort, count, 3 * fast::kGridBits);
    exec.for_each(fast::MakeLeaves{m.references, m.sort.values[1], m.nodes}, count);
    return count;
}

/// Joins all leaves in rounds; the root is the last node.
template <class Exec>
void join_leaves(Exec& exec, const FastBuildMemory& m, uint32_t leaves) {
    exec.for_each(fast::FirstClusters{m.clusters[0]}, leaves);
    uint32_t next = leaves;
    bool slow = false;
    for (uint32_t count = leaves, from = 0; count > 1; from ^= 1) {
        if (slow)
            exec.for_each(fast::PairUp{count, m.partner}, count);
        else
            exec.for_each(fast::FindPartner{m.nodes, m.clusters[from], count, m.partner}, count);
        exec.for_each(fast::MarkStaying{m.partner, count, m.stays}, count + 1);
        exec.scan(m.scan, m.stays, m.stays, count + 1);
        exec.for_each(fast::JoinPairs{m.partner, m.stays, m.clusters[from], m.clusters[from ^ 1], m.nodes, m.plans,
                                      leaves, next},
                      count);
        const uint32_t left = exec.read(m.stays + count);
        next += count - left;
        slow = count - left < count / 16;
        count = left;
    }
}

template <class Exec>
void widen(Exec& exec, const FastBuildMemory& m, FastBuild& build) {
    exec.write(m.wide.binary, 2 * build.tree.leaves - 2);  // the root
    build.nodes = 1;
    for (uint32_t first = 0; first < build.nodes; ++build.depth) {
        const uint32_t count = build.nodes - first;
        exec.for_each(fast::CountChildren{build.tree, m.wide.binary + first, count, m.inner, m.primitives}, count + 1);
        exec.scan(m.scan, m.inner, m.inner, count + 1);
        exec.scan(m.scan, m.primitives, m.primitives, count + 1);
        exec.for_each(fast::PlaceChildren{build.tree, m.wide, first, build.nodes, build.primitives, m.inner,
                                          m.primitives},
                      count);
        first = build.nodes;
        build.nodes += exec.read(m.inner + count);
        build.primitives += exec.read(m.primitives + count);
    }
}

}  // namespace detail

/// All but the nodes themselves, of a scene without groups. `Exec` runs functions over numbers, sorts, sums, and copies
/// one number from and to its memory.
template <class Exec>
FastBuild plan_fast_build(Exec& exec, const SceneView& scene, const FastBuildMemory& m) {
    FastBuild build;
    build.tree = {m.nodes, m.plans, detail::make_leaves(exec, scene, m)};
    if (build.tree.leaves == 0) {
        build.nodes = build.depth = 1;
        return build;
    }
    detail::join_leaves(exec, m, build.tree.leaves);
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
