// New trees from what was recorded, between phases: by a thread for each leaf, whose number is bounded.
#pragma once

#include "integrators/shared/guide/records.h"

namespace ambilux {

/// Which step of learning a launch belongs to: a round of training before the first iteration, or what follows an
/// iteration (kGuideRounds).
struct GuideStep {
    static constexpr const char* kName = "guide_update";
    static constexpr int64_t kNoLeaf = -1;  ///< of GuidedState::records

    GuidedState state;
    GuidedSettings settings;
    StageRecord* record;
    uint32_t round = 0;

    AMBILUX_HD const GuideTree& tree() const { return state.tree; }
    AMBILUX_HD GuideProgress& progress() const { return *state.progress; }
    /// Of a count and a sum that is not 0.
    AMBILUX_HD float mean_radiance(const int64_t* sum) const {
        return LearnRecords::kWeight * float(sum[1]) / float(sum[0]) * progress().unit[uint32_t(GuideSum::radiance)];
    }
    /// Samples of one tree are twice those of the one before: 1, 2, 4, ... iterations.
    AMBILUX_HD bool is_due() const {
        if (round < kGuideRounds) return progress().rounds == round;
        const uint32_t iterations = progress().iterations + 1;
        return (iterations & (iterations - 1)) == 0;
    }
};

/// The first stage of a step, and units of sums once light was found: from the mean of all values so far. Nothing is
/// learned before.
struct BeginUpdate : GuideStep {
    AMBILUX_HD void operator()(uint32_t) const {
        GuideProgress& p = progress();
        p.updating = is_due() && p.unit[0] > 0.0f;
        p.found = 0;
        if (!is_due()) return;
        for (uint32_t k = 0; k < kGuideSums; ++k)
            if (p.unit[k] == 0.0f) p.unit[k] = unit_of(state.exponents + k * GuidedState::kExponents);
    }

private:
    AMBILUX_HD static float unit_of(const int64_t* exponents) {
        double sum = 0.0, count = 0.0;
        for (uint32_t e = 0; e < GuidedState::kExponents - 1; ++e) {
            count += double(exponents[e]);
            sum += double(exponents[e]) * double(bits_float(FloatBits(e) << kFractionBits));
        }
        return count > 0.0 ? clamp(float(sum / count / double(LearnRecords::kMean)), 1e-37f, 1e30f) : 0.0f;
    }
};

/// A quadtree and its probabilities from the sums of its cells; the sums are zero again.
struct RefineQuads : GuideStep {
    static constexpr float kLeastFound = 4.0f;  ///< records of a quadrant from which on it is a node
    static constexpr float kPrior = 1.0f;       ///< records that every quadrant of a node has beforehand: no density
                                                ///< is 0, and few records make no spikes
    static constexpr float kLeastRadiance = 0.01f, kLeastMoment = 0.005f;  ///< share of a leaf from which on a
                                                                           ///< quadrant is a node

    AMBILUX_HD void operator()(uint32_t leaf) const {
        if (!progress().updating || leaf >= progress().leaves) return;
        GuideLeaf& of = tree().leaves[leaf];
        const uint32_t first = leaf * GuideQuads::kNodes;
        const float total = sum_up(first, of.quads);
        const int64_t found = found_in(first);
        state.records[leaf] = found;
        fetch_add_shared(&progress().found, found);
        if (!(total > 0.0f)) return;
        const uint32_t nodes = rebuild(first, total, float(found));
        for (uint64_t k = 4ull * first; k < 4ull * (first + max(nodes, uint32_t(of.quads))); ++k)
            state.sums[k] = state.found[k] = 0;
        of.quads = uint16_t(nodes);
        int64_t* reflected = state.reflected + 2 * leaf;
        if (reflected[1] > 0) of.reflected = mean_radiance(reflected);
        reflected[0] = reflected[1] = 0;
        of.bsdf_share = best_share(state.shares + leaf * GuideShares::kCount, of.bsdf_share);
    }

private:
    /// A new node before it has its probabilities.
    struct Begun {
        float mass;
        uint32_t level;
        uint32_t from;  ///< the old node + 1; 0: there was none
        float found;    ///< records
    };

    /// Of the sums, which are zero again. `now`: 1 before anything was learned.
    AMBILUX_HD float best_share(int64_t* sums, float now) const {
        if (!settings.learn_share || now == 1.0f || sums[0] == 0) return now == 1.0f ? settings.bsdf_share : now;
        uint32_t best = 0;
        for (uint32_t k = 1; k < GuideShares::kCount; ++k)
            if (sums[k] < sums[best]) best = k;
        for (uint32_t k = 0; k < GuideShares::kCount; ++k) sums[k] = 0;
        return GuideShares::of(best);
    }
    /// Masses of the quadrants of all nodes go to state.old, and records of nodes to the quadrants that they are;
    /// returns the mass of all. `first`: the root.
    AMBILUX_HD float sum_up(uint32_t first, uint32_t count) const {
        const GuideQuads& quads = tree().quads;
        const GuideMasses& old = state.old;
        set_start(old.masses[first], 0u);
        for (uint32_t n = first; n < first + count; ++n) {
            const uint32_t children = old.children[n] = start_of<GuideQuads::Node>(quads.nodes[n]).children;
            for (uint32_t q = 0; q < 4; ++q)
                if (const uint32_t c = GuideQuads::child(children, q))
                    set_start(old.masses[first + c], start_of<uint32_t>(old.masses[n]) + 1);
        }
        float total = 0.0f;
        for (uint32_t n = first + count; n-- > first;) {
            const uint32_t level = start_of<uint32_t>(old.masses[n]) + 1;
            const auto mass = [&](uint32_t q) {
                const uint32_t c = GuideQuads::child(old.children[n], q);
                if (c) state.found[4ull * n + q] = found_in(first + c);
                return c ? sum_of(old.of(first + c)) : cell_mass(float(state.sums[4ull * n + q]), level);
            };
            const Vec4f masses = {mass(0), mass(1), mass(2), mass(3)};
            set_start(old.masses[n], masses);
            total = sum_of(masses);
        }
        return total;
    }
    AMBILUX_HD int64_t found_in(uint32_t node) const {
        const int64_t* f = state.found + 4ull * node;
        return f[0] + f[1] + f[2] + f[3];
    }
    AMBILUX_HD static float sum_of(Vec4f m) { return (m.x + m.y) + (m.z + m.w); }
    /// Of target moment the density is the root of a density.
    AMBILUX_HD float cell_mass(float sum, uint32_t level) const {
        return settings.target == GuideTarget::moment ? sqrtf(ldexpf(sum, -2 * int(level))) : sum;
    }
    /// Of the quadrants of a node with so many records.
    AMBILUX_HD static Vec4f probabilities(Vec4f mass, float found) {
        const float inverse = 1.0f / (found + 4.0f * kPrior), scale = found * inverse / sum_of(mass),
                    more = kPrior * inverse;
        return {mass.x * scale + more, mass.y * scale + more, mass.z * scale + more, mass.w * scale + more};
    }
    /// Nodes in the order of their levels. Where there was a cell, a node has four alike. Returns how many.
    AMBILUX_HD uint32_t rebuild(uint32_t first, float total, float all_found) const {
        const GuideQuads& quads = tree().quads;
        const float least = total * (settings.target == GuideTarget::moment ? kLeastMoment : kLeastRadiance);
        uint32_t count = 1;
        set_start(quads.nodes[first], Begun{total, 0, 1, all_found});
        for (uint32_t n = 0; n < count; ++n) {
            const Begun begun = start_of<Begun>(quads.nodes[first + n]);
            const float even = 0.25f * begun.mass;
            const Vec4f mass = begun.from ? state.old.of(first + begun.from - 1) : Vec4f{even, even, even, even};
            const uint32_t old_children = begun.from ? state.old.children[first + begun.from - 1] : 0;
            uint32_t children = 0;
            for (uint32_t q = 0; q < 4; ++q) {
                const float m = GuideQuads::of(mass, q),
                            found = begun.from ? float(state.found[4ull * (first + begun.from - 1) + q])
                                               : 0.25f * begun.found;
                if (!(m > least && found >= kLeastFound) || count == GuideQuads::kNodes ||
                    begun.level + 2 > GuideQuads::kLevels)
                    continue;
                const uint32_t was = GuideQuads::child(old_children, q);
                set_start(quads.nodes[first + count], Begun{m, begun.level + 1, was ? was + 1 : 0, found});
                children |= count++ << 8 * q;
            }
            set_start(quads.nodes[first + n], GuideQuads::node(probabilities(mass, begun.found), children));
        }
        return count;
    }
};

/// How many leaves a leaf gets beside: it is halved until each would have no more records than a threshold, with which
/// all of them have room.
struct CountSplits : GuideStep {
    AMBILUX_HD void operator()(uint32_t leaf) const {
        state.splits[leaf] = 0;
        const GuideProgress& p = progress();
        if (!p.updating || p.leaves == state.most_leaves) return;
        if (leaf >= p.leaves) {
            state.records[leaf] = kNoLeaf;
            return;
        }
        const float most = max(float(settings.split) * sqrtf(float(1u << min(p.updates, 30u))),
                               2.0f * float(p.found) / float(state.most_leaves - p.leaves));
        float records = float(state.records[leaf]);
        if (tree().leaves[leaf].bsdf_share == 1.0f) return;
        uint32_t levels = 0, depth = tree().leaves[leaf].depth;
        for (; records > most && depth + levels < GuideTree::kMostDepth && levels < 12; ++levels) records *= 0.5f;
        state.splits[leaf] = (1u << levels) - 1;
    }
};

/// Leaves that have room split. New nodes lie in the order of leaves.
struct SplitLeaves : GuideStep {
    AMBILUX_HD void operator()(uint32_t leaf) const {
        const uint32_t more = state.splits[leaf], first = progress().leaves + state.places[leaf];
        if (more == 0 || first + more > state.most_leaves) return;
        const GuideLeaf whole = tree().leaves[leaf];
        const uint32_t base = 2 * first - 1;  // of new nodes in tree.space
        const auto place = [&](uint32_t heap) { return heap == 1 ? whole.node : base + heap - 2; };
        for (uint32_t heap = 1; heap <= more; ++heap) tree().space[place(heap)] = place(2 * heap);
        for (uint32_t k = 0; k <= more; ++k) {
            const uint32_t node = place(more + 1 + k), id = k == 0 ? leaf : first + k - 1;
            tree().space[node] = GuideTree::kLeafBit | id;
            tree().leaves[id] = whole;
            tree().leaves[id].node = node;
            tree().leaves[id].depth = uint16_t(whole.depth + log2_of(more + 1));
            if (k > 0) state.records[id] = leaf;
        }
    }

private:
    AMBILUX_HD static uint32_t log2_of(uint32_t power) {
        uint32_t n = 0;
        while (power >>= 1) ++n;
        return n;
    }
};

/// New leaves have the quadtree of the leaf that they were a part of.
struct CopyQuads : GuideStep {
    AMBILUX_HD void operator()(uint32_t leaf) const {
        if (!progress().updating || leaf < progress().leaves || state.records[leaf] == kNoLeaf) return;
        const GuideQuads& q = tree().quads;
        const uint32_t from = uint32_t(state.records[leaf]) * GuideQuads::kNodes, to = leaf * GuideQuads::kNodes;
        for (uint32_t n = 0; n < tree().leaves[leaf].quads; ++n) q.nodes[to + n] = q.nodes[from + n];
    }
};

/// Where descents begin, of the new tree.
struct FillGrid : GuideStep {
    AMBILUX_HD void operator()(uint32_t cell) const {
        if (!progress().updating) return;
        constexpr uint32_t kSide = GuideTree::kGridSide;
        const uint32_t i = cell % kSide, j = cell / kSide % kSide, k = cell / (kSide * kSide);
        const auto middle = [](uint32_t c) { return (float(c) + 0.5f) / float(kSide); };
        tree().grid[cell] = tree().descend(tree().space[0], {middle(i), middle(j), middle(k)}, GuideTree::kGridDepth);
    }
};

/// What pixels of a tile are expected to be.
struct UpdateTiles : GuideStep {
    AMBILUX_HD void operator()(uint32_t tile) const {
        const int64_t* sums = state.tiles + 2 * tile;
        if (is_due() && sums[1] > 0) state.over_pixel[tile] = 1.0f / mean_radiance(sums);
    }
};

/// The last stage of a step.
struct EndUpdate : GuideStep {
    AMBILUX_HD void operator()(uint32_t) const {
        GuideProgress& p = progress();
        if (p.updating) {
            p.leaves += new_leaves();
            ++p.updates;
        }
        p.updating = 0;
        if (round == kGuideRounds)
            ++p.iterations;
        else if (p.rounds == round)
            ++p.rounds;
    }

private:
    /// Of those with room: all before the first that has none.
    AMBILUX_HD uint32_t new_leaves() const {
        const uint32_t room = state.most_leaves - progress().leaves;
        uint32_t begin = 0, end = state.most_leaves;  // leaves before `begin` have room
        while (begin < end) {
            const uint32_t middle = begin + (end - begin) / 2;
            if (state.places[middle] + state.splits[middle] <= room)
                begin = middle + 1;
            else
                end = middle;
        }
        return begin > 0 ? state.places[begin - 1] + state.splits[begin - 1] : 0;
    }
};

/// All of a step.
struct GuideUpdate {
    BeginUpdate begin;
    RefineQuads refine;
    CountSplits count;
    SplitLeaves split;
    CopyQuads copy;
    FillGrid grid;
    UpdateTiles tiles;
    EndUpdate end;

    static GuideUpdate of(const GuideStep& step) {
        return {{step}, {step}, {step}, {step}, {step}, {step}, {step}, {step}};
    }
    template <class Executor>
    void run(Executor& exec) const {
        const GuidedState& s = begin.state;
        exec.for_each(begin, 1);
        exec.for_each(refine, s.most_leaves);
        exec.for_each(count, s.most_leaves);
        exec.scan(s.scan, s.splits, s.places, s.most_leaves, begin.record);
        exec.for_each(split, s.most_leaves);
        exec.for_each(copy, s.most_leaves);
        exec.for_each(grid, GuideTree::kGridCells);
        if (s.tile_count > 0) exec.for_each(tiles, s.tile_count);
        exec.for_each(end, 1);
    }
};

}  // namespace ambilux
