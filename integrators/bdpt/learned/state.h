// What variant learned keeps from iteration to iteration: the trees of cells and clusters, and the table between them.
#pragma once

#include "integrators/bdpt/learned/cells.h"
#include "integrators/bdpt/learned/draws.h"
#include "integrators/bdpt/learned/settings.h"
#include "integrators/bdpt/shared/policy.h"
#include "integrators/kept_state.h"

namespace ambilux {

struct LearnedPolicy : BdptPolicy {
    LearnedSettings learned;
    DrawCells found;  ///< by the pilot
};

struct LearnedState {
    static constexpr StateKind kKind = StateKind::per_device;
    static constexpr uint32_t kCellLevels = 9, kClusterLevels = 8, kCells = 1u << kCellLevels,
                              kClusters = 1u << kClusterLevels;

    DrawTable table;

    static LearnedState lay_out(Layout& layout, const LearnedPolicy& p, const StateSize&) {
        if (!p.rules.connect) return {};
        return {{{layout.allocate<DrawSplit>(kCells), kCellLevels},
                 {layout.allocate<DrawSplit>(kClusters), kClusterLevels},
                 layout.allocate<uint16_t>(kCells * kClusters),
                 layout.allocate<int64_t>(kCells * kClusters),
                 0x1p20f / p.found.unit}};
    }
    template <class Put>
    void init(const LearnedPolicy& p, Put put) const {
        if (!p.rules.connect) return;
        put(table.cells.splits, p.found.cells);
        put(table.clusters.splits, p.found.clusters);
    }
    /// The trees follow from the scene and the seed; what was learned does not.
    template <class Visit>
    void for_each_saved(Visit visit) const {
        if (!table.sums) return;
        visit("draws", table.tickets, uint64_t(kCells) * kClusters);
        visit("scores", table.sums, uint64_t(kCells) * kClusters);
    }
};

}  // namespace ambilux
