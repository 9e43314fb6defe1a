// Places that a warp of a device takes ahead. All warps add to the counter of a queue, one after the other, and wait
// for what it was: warps that take a stretch of places at a time do so less often. It pays where lanes push one by one;
// where a whole warp pushes it takes more instructions than it saves (docs/performance.md). What a warp leaves over are
// holes, all of whose bits are set: whoever goes through the queue skips items whose path is kNoPath
// (Queue::push_loosely).
#pragma once

#include "core/hd.h"
#include "queues/counter.h"

namespace ambilux {

/// Most places that all warps of a launch leave over. A queue needs so many more, or a sixteenth more if that is less.
constexpr uint32_t kMostHoles = 1u << 19;

/// Places of a queue for `items` that are pushed loosely by launches over at most as many.
constexpr uint32_t with_holes(uint32_t items) {
    const uint32_t holes = items / 16 < kMostHoles ? items / 16 : kMostHoles;
    return items < ~0u - holes ? items + holes : ~0u;
}

#if defined(__CUDACC__)

/// Stretches of a block's warps, in shared memory, of one queue that the kernel pushes to.
class WarpStretches {
public:
    static constexpr uint32_t kMostWarps = 4;

    /// Those of the calling block.
    __device__ static WarpStretches& mine() {
        __shared__ WarpStretches stretches;
        return stretches;
    }

    /// For a launch over `items`, by all threads of the block before anything is pushed.
    __device__ void open(uint32_t items) {
        if (threadIdx.x == 0) {
            const uint32_t most = (items / 16 < kMostHoles ? items / 16 : kMostHoles) / (gridDim.x * (blockDim.x / 32));
            size_ = most < 64 ? 0 : most < 128 ? 64 : 128;
        }
        if (threadIdx.x < blockDim.x / 32) places_[threadIdx.x] = 0;
        __syncthreads();
    }
    /// Fills what is left with holes, by all threads of the block after everything is pushed.
    __device__ void close() {
        if (size_ == 0) return;
        __syncwarp();
        const uint32_t next = uint32_t(places_[threadIdx.x / 32]), end = uint32_t(places_[threadIdx.x / 32] >> 32);
        if (next == end) return;
        const Target& t = targets_[threadIdx.x / 32];
        const uint32_t last = end < t.capacity ? end : t.capacity;
        for (uint32_t lane = 0; lane < t.lanes; ++lane)
            for (uint32_t i = next + threadIdx.x % 32; i < last; i += 32)
                t.base[lane * t.lane_stride + i * t.place_stride] = {{~0u, ~0u, ~0u, ~0u}};
        if (threadIdx.x % 32 == 0 && next < last) atomicAdd(&t.counter->holes, last - next);
    }

    /// A queue: lane k of place i is at base[k * lane_stride + i * place_stride].
    struct Target {
        QueueCounter* counter;
        Lane* base;
        size_t lane_stride, place_stride;
        uint32_t lanes, capacity;
    };

    /// A place for the calling thread. Threads of a warp that come together take theirs together; others may come in
    /// between.
    __device__ uint32_t take(const Target& queue) {
        const uint32_t together = __activemask(), wanted = uint32_t(__popc(together)), rank = lane_rank(together),
                       leader = uint32_t(__ffs(int(together)) - 1);
        uint32_t first = 0, from_first = 0, second = 0;
        if (rank == 0) {
            unsigned long long& mine = places_[threadIdx.x / 32];
            const unsigned long long places = *const_cast<volatile unsigned long long*>(&mine);
            bool refill = false;
            // No second try if others came in between: a loop that may wait for them makes the lanes of a warp part for
            // good.
            if (size_ > 0 && places != kRefilled) {
                first = uint32_t(places);
                const uint32_t left = uint32_t(places >> 32) - first;
                const bool enough = left >= wanted;
                if (atomicCAS(&mine, places, enough ? places + wanted : kRefilled) == places) {
                    from_first = enough ? wanted : left;
                    refill = !enough;
                }
            }
            if (from_first < wanted) {
                const uint32_t rest = wanted - from_first, taken = refill ? size_ : rest;
                second = add_to(&queue.counter->count, taken);
                if (refill) {
                    targets_[threadIdx.x / 32] = queue;
                    atomicExch(&mine, (unsigned long long)(second + taken) << 32 | (second + rest));
                }
                second -= from_first;
            }
        }
        first = __shfl_sync(together, first, int(leader));
        from_first = __shfl_sync(together, from_first, int(leader));
        second = __shfl_sync(together, second, int(leader));
        return (rank < from_first ? first : second) + rank;
    }

private:
    static constexpr unsigned long long kRefilled = ~0ull;  ///< by other lanes of the warp just now

    unsigned long long places_[kMostWarps];  ///< next | end << 32
    Target targets_[kMostWarps];             ///< once there are places
    uint32_t size_;                          ///< places of a stretch; 0: none are taken ahead
};

#endif

}  // namespace ambilux
