// The counter of a queue, which lives where the kernels run.
#pragma once

#include <cstdint>

#include "core/warp.h"

namespace ambilux {

/// Path of an empty slot.
constexpr uint32_t kNoPath = 0xffffffffu;

/// State of one queue. Counters lie a kilobyte apart: those that share a part of a device's cache are added to one
/// after the other; one cache line more, lest all fall into few sets of a host's. `count` goes on counting when the
/// queue is full, so that what is lost is known.
struct QueueCounter {
    uint32_t count;     ///< slots given out since the queue was last emptied; of a queue by path known on a device only
                        ///< when it has been counted
    uint32_t capacity;  ///< slots
    uint64_t peak;      ///< most slots given out in one filling
    uint64_t
        overflow;    ///< items lost: slots past the capacity, or one that was occupied (which only the host looks for)
    uint32_t next;   ///< items that threads of a launch have claimed
    uint32_t holes;  ///< slots below `count` that are empty (queues/reserved_queue.h)
    uint32_t pad[264];

    /// Slots to go through.
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
/// Adds to a counter that other threads add to, and returns what it was. By hand, since compilers look once more for
/// threads that add to one counter.
__device__ inline uint32_t add_to(uint32_t* counter, uint32_t n) {
    uint32_t before;
    asm volatile("atom.global.add.u32 %0, [%1], %2;"
                 : "=r"(before)
                 : "l"(__cvta_generic_to_global(counter)), "r"(n)
                 : "memory");
    return before;
}
#endif

/// Allocates one slot for the calling thread. On a device the lanes of a warp that push together share one atomic
/// operation, so all of them must push to the same queue: a queue that differs from lane to lane is chosen by a branch.
/// Debug builds trap otherwise.
AMBILUX_HD uint32_t allocate_slot(uint32_t* count) {
#if defined(__CUDA_ARCH__)
    const Warp warp;
    uint32_t first = 0;
#if !defined(NDEBUG)
    if (warp.first(reinterpret_cast<uintptr_t>(count)) != reinterpret_cast<uintptr_t>(count)) __trap();
#endif
    if (warp.rank() == 0) first = add_to(count, warp.size());
    return warp.first(first) + warp.rank();
#else
    return (*count)++;  // a host queue belongs to one thread
#endif
}

}  // namespace ambilux
