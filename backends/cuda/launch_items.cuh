// The items that a launch goes through, and how the warps of a device share them.
#pragma once

#include <cuda_runtime.h>

#include "backends/cuda/launch_traits.h"
#include "queues/queue.h"

namespace ambilux::detail {

/// From so many items on a sort pays; fewer are shaded in the time that its launches take.
constexpr uint32_t kSortFrom = 1u << 15;

/// The items that a launch goes through.
struct Items {
    QueueCounter* counter;
    const uint32_t* list;  ///< their places; null: places 0, 1, 2 ...
    uint8_t* flags;        ///< Queue::flags
    uint32_t capacity;
    const uint32_t* sorted;  ///< instead of `list` if there are at least kSortFrom items; null: never
    const uint16_t* keys;    ///< that `sorted` is in the order of; null: every item is to be looked at
    uint16_t end;            ///< key from which on items contribute nothing

    /// Places to look at.
    __device__ uint32_t size() const { return flags && !list ? capacity : counter->size(); }
    /// What to go through when size() is `n`.
    __device__ Items of(uint32_t n) const {
        const bool in_order = sorted && n >= kSortFrom;
        return {counter, in_order ? sorted : list, flags, capacity, nullptr, in_order ? keys : nullptr, end};
    }
    /// How many of the first n items may contribute, which all threads of a block ask together.
    __device__ uint32_t useful(uint32_t n) const {
        if (!keys) return n;
        uint32_t first = 0, last = n;  // what is asked for lies between them
        while (first < last) {
            const uint32_t step = (last - first + kStageBlock - 1) / kStageBlock, probe = first + threadIdx.x * step;
            const uint32_t below = uint32_t(__syncthreads_count(probe < last && keys[probe] < end));
            if (below == 0) return first;
            last = min(last, first + below * step);
            first += (below - 1) * step + 1;
        }
        return first;
    }
    __device__ uint32_t place(uint32_t i) const { return list ? list[i] : i; }
    /// False if there is no item. What is taken must be used: its place is empty from now on.
    __device__ bool claim(uint32_t place) const {
        if (!flags) return true;
        if (!list && !flags[place]) return false;
        flags[place] = 0;
        return true;
    }
};

/// body(i), by whole warps, for all i below n and for as many more as fill a warp. Warps claim their next run of
/// items when they are done with the last: what is in work lies together, so that all run the same material, and none
/// has more to do than others. Runs are long, since claiming one waits, but not so long that warps would end far
/// apart; where items are few, each warp has its own. *next must be 0 when the kernel starts.
template <class Body>
__device__ void in_turns(uint32_t n, uint32_t* next, Body body) {
    const uint32_t lane = threadIdx.x % 32, threads = gridDim.x * blockDim.x,
                   run = n / threads >= 64   ? 256
                         : n / threads >= 16 ? 64
                                             : 32;
    uint32_t i = (blockIdx.x * blockDim.x + threadIdx.x) / 32 * run + lane;
    while (i - lane < n) {
        body(i);
        i += 32;
        if ((i & (run - 1)) >= 32) continue;
        if (run == 32) {
            i += threads - 32;
            continue;
        }
        __syncwarp();
        uint32_t taken = 0;
        if (lane == 0) taken = add_to(next, run);
        i = threads / 32 * run + __shfl_sync(0xffffffffu, taken, 0) + lane;
    }
}

}  // namespace ambilux::detail
