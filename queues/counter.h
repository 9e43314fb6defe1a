// What a queue is made of: lanes of 16 bytes, and a counter that lives where the kernels run.
#pragma once

#include "core/hd.h"

#include <cstdint>

namespace ambilux {

/// The unit of storage: one coalesced access per thread.
struct alignas(16) Lane {
    uint32_t word[4];
};

/// Path of an item that is none.
constexpr uint32_t kNoPath = 0xffffffffu;

/// State of one queue. Counters lie a kilobyte apart: those that share a part of a device's cache are added to one
/// after the other; one cache line more, lest all fall into few sets of a host's. `count` goes on counting when the
/// queue is full, so that what is lost is known.
struct QueueCounter {
    uint32_t count;  ///< places given out since the queue was last emptied; of a queue of fixed places known on a
                     ///< device only when it has been counted
    uint32_t capacity;
    uint64_t peak;      ///< most places given out in one filling
    uint64_t overflow;  ///< items lost: places past the capacity, or to a fixed place that was taken (which only the
                        ///< host looks for)
    uint32_t next;      ///< items that threads of a launch have taken in turns
    uint32_t holes;     ///< places below `count` that hold no item (queues/stretch.h)
    uint32_t pad[264];

    /// Places to go through.
    AMBILUX_HD uint32_t size() const { return count < capacity ? count : capacity; }
    AMBILUX_HD uint32_t items() const { return size() - holes; }
    /// Empties the queue and keeps what its filling tells.
    AMBILUX_HD void finish() {
        if (count > peak) peak = count;
        if (count > capacity) overflow += count - capacity;
        count = 0;
        next = 0;
        holes = 0;
    }
};

static_assert(sizeof(QueueCounter) == 1024 + 64);

#if defined(__CUDACC__)
/// Rank of the calling lane among the lanes of `mask`.
__device__ inline uint32_t lane_rank(uint32_t mask) {
    uint32_t below;
    asm("mov.u32 %0, %%lanemask_lt;" : "=r"(below));
    return uint32_t(__popc(mask & below));
}

/// Adds to a counter that other threads add to, and returns what it was. By hand, since compilers look once more for
/// threads that add to one place.
__device__ inline uint32_t add_to(uint32_t* counter, uint32_t n) {
    uint32_t before;
    asm volatile("atom.global.add.u32 %0, [%1], %2;"
                 : "=r"(before)
                 : "l"(__cvta_generic_to_global(counter)), "r"(n)
                 : "memory");
    return before;
}
#endif

/// Takes one place for the calling thread. On a device the threads of a warp that push together take theirs with one
/// atomic operation, so all of them must push to the same queue: a queue that differs from thread to thread is to be
/// chosen by a branch.
AMBILUX_HD uint32_t take_place(uint32_t* count) {
#if defined(__CUDA_ARCH__)
    const uint32_t together = __activemask(), rank = lane_rank(together);
    uint32_t first = 0;
    if (rank == 0) first = add_to(count, uint32_t(__popc(together)));
    return __shfl_sync(together, first, __ffs(int(together)) - 1) + rank;
#else
    return (*count)++;  // a host queue belongs to one thread
#endif
}

}  // namespace ambilux
