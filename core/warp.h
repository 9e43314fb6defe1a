// What the threads of a warp do together. On a host every thread is a warp of its own.
#pragma once

#include <cstdint>

#include "core/hd.h"

#if defined(__CUDACC__)
#include <cooperative_groups.h>
#endif

namespace ambilux {

#if defined(__CUDACC__)
/// Rank of the calling lane among the lanes of `mask`.
__device__ inline uint32_t lane_rank(uint32_t mask) {
    uint32_t below;
    asm("mov.u32 %0, %%lanemask_lt;" : "=r"(below));
    return uint32_t(__popc(mask & below));
}
#endif

/// The lanes of a warp that come here together. All of them make the same calls.
struct Warp {
#if defined(__CUDA_ARCH__)
    cooperative_groups::coalesced_group lanes = cooperative_groups::coalesced_threads();

    __device__ uint32_t rank() const { return lanes.thread_rank(); }
    __device__ uint32_t size() const { return lanes.size(); }
    /// Lanes that have left each other go on together.
    __device__ void meet() const { lanes.sync(); }
    /// What the first lane has.
    template <class T>
    __device__ T first(T value) const {
        return lanes.shfl(value, 0);
    }
#else
    AMBILUX_HD static uint32_t rank() { return 0; }
    AMBILUX_HD static uint32_t size() { return 1; }
    AMBILUX_HD static void meet() {}
    template <class T>
    AMBILUX_HD static T first(T value) {
        return value;
    }
#endif
};

/// All lanes of a warp of a device, none of which has ended.
struct WholeWarp {
    AMBILUX_HD void meet() const {
#if defined(__CUDA_ARCH__)
        __syncwarp();
#endif
    }
    /// For how many lanes `b` is true.
    AMBILUX_HD uint32_t count(bool b) const {
#if defined(__CUDA_ARCH__)
        return uint32_t(__popc(__ballot_sync(0xffffffffu, b)));
#else
        return b;
#endif
    }
};

/// All threads of a block of a device, none of which has ended. On a host every thread is a block of its own.
struct WholeBlock {
    AMBILUX_HD void meet() const {
#if defined(__CUDA_ARCH__)
        __syncthreads();
#endif
    }
    /// For how many threads `b` is true.
    AMBILUX_HD uint32_t count(bool b) const {
#if defined(__CUDA_ARCH__)
        return uint32_t(__syncthreads_count(b));
#else
        return b;
#endif
    }
};

/// The lanes that come together with the same key.
struct SameKey {
    uint32_t lanes = 1;  ///< as bits

    AMBILUX_HD bool has_several_lanes() const { return lanes & (lanes - 1); }
    AMBILUX_HD bool is_first() const {
#if defined(__CUDA_ARCH__)
        return (threadIdx.x & 31u) == uint32_t(__ffs(int(lanes)) - 1);
#else
        return true;
#endif
    }
    AMBILUX_HD uint32_t count() const {
#if defined(__CUDA_ARCH__)
        return uint32_t(__popc(lanes));
#else
        return 1;
#endif
    }
};
template <class Key>
AMBILUX_HD SameKey same_key([[maybe_unused]] Key key) {
#if defined(__CUDA_ARCH__)
    return {__match_any_sync(__activemask(), key)};
#else
    return {};
#endif
}

}  // namespace ambilux
