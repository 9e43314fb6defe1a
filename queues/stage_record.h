// What a stage did; lives where the kernels run.
#pragma once

#include "core/atomic.h"
#include "core/warp.h"

namespace ambilux {

/// Items are counted for depths 0 ... kTrackedDepths-1; the last entry gathers all deeper ones.
constexpr uint32_t kTrackedDepths = 64;

struct StageRecord {
    uint64_t launches, items, nanoseconds;
    uint64_t nan, inf, negative;  ///< values it dropped
    uint64_t underflow;           ///< light that became 0 because it is below the range of floats
    uint64_t items_by_depth[kTrackedDepths];

    AMBILUX_HD void add(uint64_t new_items, uint32_t depth, uint64_t ns) {
        ++launches;
        items += new_items;
        nanoseconds += ns;
        items_by_depth[tracked(depth)] += new_items;
    }
    void add(const StageRecord& other) {
        launches += other.launches;
        items += other.items;
        nanoseconds += other.nanoseconds;
        nan += other.nan;
        inf += other.inf;
        negative += other.negative;
        underflow += other.underflow;
        for (uint32_t d = 0; d < kTrackedDepths; ++d) items_by_depth[d] += other.items_by_depth[d];
    }
    /// Items that no launch was made for, or, less than 0, that it has left.
    AMBILUX_HD void count_items(int64_t n, uint32_t depth) {
        if (n == 0) return;
        add_count(&items, n);
        add_count(items_by_depth + tracked(depth), n);
    }
    /// An item that no launch was made for. Lanes that count together add once.
    AMBILUX_HD void count_item(uint32_t depth) {
        const SameKey same = same_key(tracked(depth));
        if (same.is_first()) count_items(same.count(), depth);
    }

private:
    AMBILUX_HD static uint32_t tracked(uint32_t depth) { return depth < kTrackedDepths ? depth : kTrackedDepths - 1; }
};

}  // namespace ambilux
