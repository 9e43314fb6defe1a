// A binary tree from the leaves up: neighbours along Morton's curve are joined where each is the other's best (Meister
// and Bittner 2018, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction"; Benthin et al.
// 2022). What each join costs as wide nodes is planned at once.
#pragma once

#include "accel/collapse.h"
#include "accel/fast/references.h"

namespace ambilux::fast {

/// The left child of a leaf is kNone, its right one a primitive.
struct alignas(16) Node {
    Bounds3f bounds;
    uint32_t left, right;
};
static_assert(sizeof(Node) == 32);

/// Leaves come first, then inner nodes, each behind its children.
struct Tree {
    const Node* nodes;
    const collapse::Plan* plans;  ///< of inner nodes
    uint32_t leaves;

    AMBILUX_HD collapse::How how(uint32_t i) const {
        return i < leaves ? collapse::primitive_how() : plans[i - leaves].how;
    }
    AMBILUX_HD uint32_t left(uint32_t i) const { return nodes[i].left; }
    AMBILUX_HD uint32_t right(uint32_t i) const { return nodes[i].right; }
    AMBILUX_HD const Bounds3f& bounds(uint32_t i) const { return nodes[i].bounds; }
};

/// Leaves in the order of `numbers`.
struct MakeLeaves {
    const Reference* references;
    const uint32_t* numbers;
    Node* nodes;

    AMBILUX_HD void operator()(uint32_t i) const {
        const Reference& r = references[numbers[i]];
        nodes[i] = {r.bounds, kNone, r.prim};
    }
};

/// Clusters are roots of trees that are not yet joined: at first the leaves.
struct FirstClusters {
    uint32_t* clusters;
    AMBILUX_HD void operator()(uint32_t i) const { clusters[i] = i; }
};

/// Clusters that a cluster looks at, on either side.
constexpr uint32_t kRadius = 16;

/// The neighbour that makes the smallest box with each cluster. The order of pairs is the same seen from both sides, so
/// that some are always each other's; of pairs that are as good, those go first whose numbers differ in the lowest bits
/// alone, and no run of equal boxes waits for its first.
struct FindPartner {
    const Node* nodes;
    const uint32_t* clusters;
    uint32_t count;
    uint32_t* partner;

    AMBILUX_HD void operator()(uint32_t i) const {
        const Bounds3f mine = nodes[clusters[i]].bounds;
        const uint32_t first = i < kRadius ? 0 : i - kRadius, last = count - 1 - i < kRadius ? count - 1 : i + kRadius;
        float least = kInfinity;
        uint32_t best = i == last ? i - 1 : i + 1;  // of boxes whose areas are no numbers
        for (uint32_t k = first; k <= last; ++k) {
            if (k == i) continue;
            Bounds3f both = nodes[clusters[k]].bounds;
            both.extend(mine);
            const float area = both.half_area();
            if (area > least || (area == least && (k ^ i) >= (best ^ i))) continue;
            least = area, best = k;
        }
        partner[i] = best;
    }
};

/// Pairs that lie side by side. Among boxes that grow along the curve few are each other's best.
struct PairUp {
    uint32_t count;
    uint32_t* partner;
    AMBILUX_HD void operator()(uint32_t i) const { partner[i] = (i ^ 1u) < count ? (i ^ 1u) : i; }
};

/// stays[i]: 0 if cluster i goes into one before it; that of `count` is 0, so that sums end with all.
struct MarkStaying {
    const uint32_t* partner;
    uint32_t count;
    uint32_t* stays;

    AMBILUX_HD void operator()(uint32_t i) const {
        stays[i] = i < count && !(partner[i] < i && partner[partner[i]] == i) ? 1 : 0;
    }
};

AMBILUX_HD collapse::Plan plan_of(const Node* nodes, const collapse::Plan* plans, uint32_t leaves, uint32_t i) {
    return i < leaves ? collapse::primitive_plan(nodes[i].bounds.half_area()) : plans[i - leaves];
}

/// Joins pairs; `before[i]`: clusters before i that stay.
struct JoinPairs {
    const uint32_t *partner, *before, *clusters;
    uint32_t* joined;  ///< the clusters of the next round
    Node* nodes;
    collapse::Plan* plans;
    uint32_t leaves, next;  ///< next: where the first new node goes

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t other = partner[i];
        const bool both = other != i && partner[other] == i;
        if (both && other < i) return;
        joined[before[i]] = both ? join(clusters[i], clusters[other], next + other - before[other]) : clusters[i];
    }

private:
    AMBILUX_HD uint32_t join(uint32_t left, uint32_t right, uint32_t node) const {
        Bounds3f bounds = nodes[left].bounds;
        bounds.extend(nodes[right].bounds);
        nodes[node] = {bounds, left, right};
        plans[node - leaves] = collapse::inner_plan(plan_of(nodes, plans, leaves, left),
                                                    plan_of(nodes, plans, leaves, right), bounds.half_area());
        return node;
    }
};

/// Nodes and plans of clusters.
struct GatherClusters {
    const Node* nodes;
    const collapse::Plan* plans;
    uint32_t leaves;
    const uint32_t* clusters;
    Node* out;
    collapse::Plan* out_plans;

    AMBILUX_HD void operator()(uint32_t i) const {
        out[i] = nodes[clusters[i]];
        out_plans[i] = plan_of(nodes, plans, leaves, clusters[i]);
    }
};

}  // namespace ambilux::fast
