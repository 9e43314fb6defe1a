// What a guided variant keeps from iteration to iteration: the trees, and what was recorded since they were made.
#pragma once

#include "integrators/kept_state.h"
#include "integrators/shared/guide/settings.h"
#include "integrators/shared/guide/tree.h"
#include "scene/view.h"

namespace ambilux {

/// Rounds of training before the first iteration. Their samples are not part of the image; each has twice as many paths
/// as the one before, the last all.
constexpr uint32_t kGuideRounds = 4;

/// What is summed up in integers, in a unit of its own.
enum class GuideSum : uint32_t {
    target,
    moment,
    radiance,  ///< of pixels, and what scattered rays bring
};
constexpr uint32_t kGuideSums = 3;

/// Shares of the BSDF that a leaf chooses from: the one with which the second moment of what its records brought would
/// have been least. A guide that knows little is used little.
struct GuideShares {
    static constexpr uint32_t kCount = 8;
    static constexpr float kMost = 0x1p28f;  ///< units that one record counts, at most

    AMBILUX_HD static float of(uint32_t k) { return 0.125f + 0.875f * (float(k) + 0.5f) / float(kCount); }
};

/// Of an update: quadtrees as they were, with masses of quadrants.
struct GuideMasses {
    Lane* masses;        ///< [leaf][node]
    uint32_t* children;  ///< as of GuideQuads::Node

    AMBILUX_HD Vec4f of(uint32_t node) const { return start_of<Vec4f>(masses[node]); }
};

/// How far learning has come.
struct alignas(16) GuideProgress {
    uint32_t rounds;         ///< of training that are done
    uint32_t iterations;     ///< that are done, of this state
    uint32_t updates;        ///< of the trees
    uint32_t leaves;         ///< of the tree over space
    float unit[kGuideSums];  ///< of each GuideSum; 0: not known before light was found
    uint32_t updating;       ///< the step at work makes new trees
    int64_t found;           ///< by it: records that brought something
};

/// Of one tree.
struct GuidedState {
    static constexpr uint32_t kExponents = 256;

    GuideTree tree;
    GuideMasses old;
    GuideProgress* progress;
    int64_t* sums;   ///< [leaf][node][quadrant]: what was recorded, in integers, so that any order adds up to the same
    int64_t* found;  ///< [leaf][node][quadrant]: how many records brought something
    int64_t* records;    ///< [leaf]: of an update: how many brought something; of a new leaf: what it was a part of
    int64_t* shares;     ///< [leaf][share of GuideShares]: second moments
    int64_t* reflected;  ///< [leaf][count, sum] of what scattered rays brought
    int64_t* tiles;      ///< [tile][count, sum]: samples of its pixels
    float* over_pixel;   ///< [tile]: 1 over the mean of its pixels; 0: not known
    int64_t* exponents;  ///< [sum]: how many values had this exponent, while there is no unit
    uint32_t* splits;    ///< [leaf]: leaves that it gets beside
    uint32_t* places;    ///< sums of splits
    ScanMemory scan;
    uint32_t most_leaves, tile_count;

    static GuidedState lay_out(Layout& layout, uint32_t n, uint32_t tiles, const StateSize& size) {
        const uint32_t nodes = n * GuideQuads::kNodes;
        GuidedState s{};
        s.tree.space = layout.allocate<uint32_t>(2 * n);
        s.tree.grid = layout.allocate<uint32_t>(GuideTree::kGridCells);
        s.tree.leaves = layout.allocate<GuideLeaf>(n);
        s.tree.quads = {layout.allocate<Lane>(nodes)};
        s.old = {layout.allocate<Lane>(nodes), layout.allocate<uint32_t>(nodes)};
        s.progress = layout.allocate<GuideProgress>(1);
        s.sums = layout.allocate<int64_t>(4ull * nodes);
        s.found = layout.allocate<int64_t>(4ull * nodes);
        s.records = layout.allocate<int64_t>(n);
        s.shares = layout.allocate<int64_t>(n * GuideShares::kCount);
        s.reflected = layout.allocate<int64_t>(2 * n);
        s.tile_count = tiles;
        s.tiles = layout.allocate<int64_t>(2 * s.tile_count);
        s.over_pixel = layout.allocate<float>(s.tile_count);
        s.exponents = layout.allocate<int64_t>(kGuideSums * kExponents);
        s.splits = layout.allocate<uint32_t>(n);
        s.places = layout.allocate<uint32_t>(n);
        s.scan = ScanMemory::lay_out(layout, n, size.primitives);
        s.most_leaves = n;
        return s;
    }
    /// With the cube around a scene.
    GuidedState around(const SceneView& scene) const {
        const float size = scene.bounds_radius * 1.001f;
        GuidedState s = *this;
        s.tree.low = scene.bounds_center - Vec3f{size, size, size};
        s.tree.inverse_side = size > 0.0f ? 0.5f / size : 0.0f;
        return s;
    }
    template <class Put>
    void init(Put put) const {
        put(tree.space, std::vector<uint32_t>{GuideTree::kLeafBit});
        put(tree.grid, std::vector<uint32_t>(GuideTree::kGridCells, GuideTree::kLeafBit));
        put(tree.leaves, std::vector<GuideLeaf>{{0, 0, 1, 1.0f, 0.0f}});
        put(progress, std::vector<GuideProgress>{{0, 0, 0, 1, {}, 0, 0}});
    }
    template <class Visit>
    void for_each_saved(Visit visit) const {
        const uint64_t n = most_leaves, nodes = n * GuideQuads::kNodes;
        visit("guide_progress", progress, 1);
        visit("guide_space", tree.space, 2 * n);
        visit("guide_grid", tree.grid, uint64_t(GuideTree::kGridCells));
        visit("guide_leaves", tree.leaves, n);
        visit("guide_nodes", tree.quads.nodes, nodes);
        visit("guide_sums", sums, 4 * nodes);
        visit("guide_found", found, 4 * nodes);
        visit("guide_shares", shares, n * GuideShares::kCount);
        visit("guide_reflected", reflected, 2 * n);
        visit("guide_tiles", tiles, uint64_t(2 * tile_count));
        visit("guide_over_pixel", over_pixel, uint64_t(tile_count));
        visit("guide_exponents", exponents, uint64_t(kGuideSums * kExponents));
    }
};

/// Of the trees of both sides. Of light subpaths that are not guided there is none; that of eye subpaths knows what
/// pixels are expected to be all the same.
struct GuidedStates {
    static constexpr StateKind kKind = StateKind::per_device;

    GuidedState eye, light;

    template <class Policy>
    static GuidedStates lay_out(Layout& layout, const Policy& p, const StateSize& size) {
        GuidedStates s{};
        s.eye = GuidedState::lay_out(layout, p.guided.leaves_of(Side::eye), p.training.tiles, size);
        if (p.guided.guides(Side::light))
            s.light = GuidedState::lay_out(layout, p.guided.leaves_of(Side::light), 0, size);
        return s;
    }
    GuidedStates around(const SceneView& scene) const { return {eye.around(scene), light.around(scene)}; }
    bool has_light() const { return light.most_leaves > 0; }
    template <class Policy, class Put>
    void init(const Policy&, Put put) const {
        eye.init(put);
        if (has_light()) light.init(put);
    }
    template <class Visit>
    void for_each_saved(Visit visit) const {
        eye.for_each_saved(visit);
        if (has_light()) light.for_each_saved(visit);
    }
};

}  // namespace ambilux
