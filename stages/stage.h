// What all stages share: their names, their records, and the count of values that are no light.
#pragma once

#include "core/math.h"

namespace ambilux {

/// Kernels of a wave, in the order in which they first run.
enum class StageId : uint32_t {
    light_generate = 0,
    light_extend,
    light_shade,
    connect_camera,
    generate,
    extend,
    shade,
    connect,
    connect_vertices,
    mis_weight,
    occlude,
    accumulate,
    splat,
    megakernel,
    develop,
    count
};

constexpr uint32_t kStageCount = uint32_t(StageId::count);
constexpr const char* kStageNames[kStageCount] = {
    "light_generate",   "light_extend", "light_shade", "connect_camera", "generate", "extend",     "shade",  "connect",
    "connect_vertices", "mis_weight",   "occlude",     "accumulate",     "splat",    "megakernel", "develop"};

/// Items are counted for depths 0 ... kTrackedDepths-1; the last entry gathers all deeper ones.
constexpr uint32_t kTrackedDepths = 64;

/// Adds to a counter that other threads may add to. Less than 0: subtracts.
AMBILUX_HD void count_some(uint64_t* counter, int64_t n) {
#if defined(__CUDA_ARCH__)
    atomicAdd(reinterpret_cast<unsigned long long*>(counter), static_cast<unsigned long long>(n));
#else
    *counter += uint64_t(n);  // a host record belongs to one thread
#endif
}
AMBILUX_HD void count_one(uint64_t* counter) { count_some(counter, 1); }

/// Adds 1 to counters[which]; the threads of a warp that mean the same one add once for all of them.
AMBILUX_HD void count_together(uint64_t* counters, uint32_t which) {
#if defined(__CUDA_ARCH__)
    const uint32_t same = __match_any_sync(__activemask(), which);
    if ((threadIdx.x & 31u) == uint32_t(__ffs(int(same)) - 1))
        atomicAdd(reinterpret_cast<unsigned long long*>(counters + which),
                  static_cast<unsigned long long>(__popc(same)));
#else
    ++counters[which];
#endif
}

/// What one stage did; lives where the kernels run.
struct StageRecord {
    uint64_t launches, items, nanoseconds;
    uint64_t nan, inf, negative;  ///< values it dropped
    uint64_t items_by_depth[kTrackedDepths];

    AMBILUX_HD void add(uint64_t new_items, uint32_t depth, uint64_t ns) {
        ++launches;
        items += new_items;
        nanoseconds += ns;
        items_by_depth[tracked(depth)] += new_items;
    }
    /// Items that no launch was made for, or, less than 0, that it has left.
    AMBILUX_HD void count_items(int64_t n, uint32_t depth) {
        if (n == 0) return;
        count_some(&items, n);
        count_some(items_by_depth + tracked(depth), n);
    }
    /// An item that no launch was made for.
    AMBILUX_HD void count_item(uint32_t depth) {
        count_together(&items, 0);
        count_together(items_by_depth, tracked(depth));
    }

private:
    AMBILUX_HD static uint32_t tracked(uint32_t depth) { return depth < kTrackedDepths ? depth : kTrackedDepths - 1; }
};

/// True if `v` can be light: finite and not negative. Anything else is counted in the record of the stage that made it;
/// the caller drops it.
AMBILUX_HD bool is_light(Rgb v, StageRecord* record) {
    // Finite and neither negative nor -0: the bits of such floats are below those of infinity.
    constexpr uint32_t kInfinityBits = 0x7f800000u;
    if ((float_bits(v.x) < kInfinityBits) & (float_bits(v.y) < kInfinityBits) & (float_bits(v.z) < kInfinityBits))
        return true;
    if (is_finite(v)) {
        if (min_component(v) >= 0.0f) return true;
        count_one(&record->negative);
        return false;
    }
    const bool nan = v.x != v.x || v.y != v.y || v.z != v.z;
    count_one(nan ? &record->nan : &record->inf);
    return false;
}

}  // namespace ambilux
