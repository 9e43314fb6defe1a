// A queue whose slots a warp of a device reserves ahead. All warps add to the counter of a queue, one after the other,
// and wait for what it was: warps that reserve a run of slots at a time do so less often. It pays where lanes push one
// by one; where a whole warp pushes it takes more instructions than it saves. What a warp leaves over are holes, all of
// whose bits are set: whoever goes through the queue skips items whose path is kNoPath.
#pragma once

#include "queues/queue.h"

namespace ambilux {

/// Most slots that all warps of a launch leave over. A queue needs so many more, or a sixteenth more if that is less.
constexpr uint32_t kMostHoles = 1u << 19;

/// Slots of a queue for `items` that are pushed by launches over at most as many.
constexpr uint32_t with_holes(uint32_t items) {
    const uint32_t holes = items / 16 < kMostHoles ? items / 16 : kMostHoles;
    return items < ~0u - holes ? items + holes : ~0u;
}

#if defined(__CUDACC__)

/// Slots that the warps of a block have reserved, in shared memory, of one queue that the kernel pushes to.
class ReservedSlots {
public:
    static constexpr uint32_t kMostWarps = 4;

    /// Those of the calling block.
    __device__ static ReservedSlots& of_block() {
        __shared__ ReservedSlots slots;
        return slots;
    }

    /// For a launch over `items`, by all threads of the block before anything is pushed.
    __device__ void open(uint32_t items) {
        if (threadIdx.x == 0) {
            const uint32_t most = (items / 16 < kMostHoles ? items / 16 : kMostHoles) / (gridDim.x * (blockDim.x / 32));
            run_ = most < 64 ? 0 : most < 128 ? 64 : 128;
        }
        if (threadIdx.x < blockDim.x / 32) reserved_[threadIdx.x] = 0;
        __syncthreads();
    }
    /// Fills what is left with holes, by all threads of the block after everything is pushed.
    __device__ void close() {
        if (run_ == 0) return;
        __syncwarp();
        const uint32_t next = uint32_t(reserved_[threadIdx.x / 32]), end = uint32_t(reserved_[threadIdx.x / 32] >> 32);
        if (next == end) return;
        const Target& t = targets_[threadIdx.x / 32];
        const uint32_t last = end < t.capacity ? end : t.capacity;
        for (uint32_t lane = 0; lane < t.lanes; ++lane)
            for (uint32_t i = next + threadIdx.x % 32; i < last; i += 32)
                t.base[lane * t.lane_stride + i * t.slot_stride] = {{~0u, ~0u, ~0u, ~0u}};
        if (threadIdx.x % 32 == 0 && next < last) atomicAdd(&t.counter->holes, last - next);
    }

    /// A queue: lane k of slot i is at base[k * lane_stride + i * slot_stride].
    struct Target {
        QueueCounter* counter;
        Lane* base;
        size_t lane_stride, slot_stride;
        uint32_t lanes, capacity;
    };

    /// A slot for the calling thread. Lanes that come together allocate together; others may come in between.
    __device__ uint32_t allocate(const Target& queue) {
        const Warp warp;
        const uint32_t wanted = warp.size(), rank = warp.rank();
        uint32_t first = 0, from_first = 0, second = 0;
        if (rank == 0) {
            unsigned long long& mine = reserved_[threadIdx.x / 32];
            const unsigned long long slots = *const_cast<volatile unsigned long long*>(&mine);
            bool refill = false;
            // No second try if others came in between: a loop that may wait for them makes lanes part for good.
            if (run_ > 0 && slots != kRefilled) {
                first = uint32_t(slots);
                const uint32_t left = uint32_t(slots >> 32) - first;
                const bool enough = left >= wanted;
                if (atomicCAS(&mine, slots, enough ? slots + wanted : kRefilled) == slots) {
                    from_first = enough ? wanted : left;
                    refill = !enough;
                }
            }
            if (from_first < wanted) {
                const uint32_t rest = wanted - from_first, taken = refill ? run_ : rest;
                second = add_to(&queue.counter->count, taken);
                if (refill) {
                    targets_[threadIdx.x / 32] = queue;
                    atomicExch(&mine, (unsigned long long)(second + taken) << 32 | (second + rest));
                }
                second -= from_first;
            }
        }
        first = warp.first(first);
        from_first = warp.first(from_first);
        second = warp.first(second);
        return (rank < from_first ? first : second) + rank;
    }

private:
    static constexpr unsigned long long kRefilled = ~0ull;  ///< by other lanes of the warp just now

    unsigned long long reserved_[kMostWarps];  ///< next | end << 32
    Target targets_[kMostWarps];               ///< once there are slots
    uint32_t run_;                             ///< slots that are reserved at once; 0: none
};

#endif

/// A queue that kernels push to through ReservedSlots, which they open and close; with `reserve` unset, or on a host,
/// as to any other.
template <class Item>
struct ReservedQueue {
    Queue<Item> queue;
    bool reserve = true;

    AMBILUX_HD uint32_t push(const Item& item) const {
#if defined(__CUDA_ARCH__)
        if (reserve && !queue.flags) {
            static_assert(paired_lanes<Item>() == 0, "holes are filled lane by lane");
            const LaneArray<Item>& a = queue.items;
            const uint32_t i = ReservedSlots::of_block().allocate(
                {queue.counter, a.base, a.place(0, 1), a.place(1, 0), a.kLanes, a.capacity});
            if (i < a.capacity) a.store(i, item);
            return i;
        }
#endif
        return queue.push(item);
    }
};

}  // namespace ambilux
