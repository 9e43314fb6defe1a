// Work queues: lanes of 16 bytes, so that neighbouring threads load and store neighbouring 16-byte words, and a counter that lives where the kernels run.
// Items are appended, or lie at the places of their paths (queues/order.h says what for).
#pragma once

#include <cstring>
#include <type_traits>

#include "core/hd.h"

#include <cstdint>

namespace ambilux {

/// The unit of storage: one coalesced access per thread.
struct alignas(16) Lane {
    uint32_t word[4];
};

/// The start of a lane as a value. The lane is loaded whole: copying a part of it is compiled to loads of single bytes.
template <class Value>
AMBILUX_HD Value start_of(const Lane& place) {
    static_assert(sizeof(Value) <= sizeof(Lane));
    const Lane lane = place;
    Value value;
    memcpy(&value, &lane, sizeof(value));
    return value;
}

/// Replaces a lane by `value` and zeros.
template <class Value>
AMBILUX_HD void set_start(Lane& place, const Value& value) {
    Lane lane = {};
    memcpy(&lane, &value, sizeof(value));
    place = lane;
}

/// State of one queue. Counters lie a kilobyte apart: those that share a part of a device's cache are added to one after the other; one cache line more, lest all fall into few sets of a host's. `count` goes on counting when the queue is full, so that what is lost is known.
struct QueueCounter {
    uint32_t count;     ///< items since the queue was last emptied; of a queue of fixed places known on a device only when it has been counted
    uint32_t capacity;
    uint64_t peak;      ///< most pushes of one filling
    uint64_t overflow;  ///< items lost: pushes past the capacity, or to a fixed place that was taken (which only the host looks for)
    uint32_t next;      ///< first item that no persistent thread has taken yet
    uint32_t pad[265];

    AMBILUX_HD uint32_t size() const { return count < capacity ? count : capacity; }
    /// Empties the queue and keeps what its filling tells.
    AMBILUX_HD void finish() {
        if (count > peak) peak = count;
        if (count > capacity) overflow += count - capacity;
        count = 0;
        next = 0;
    }
};

static_assert(sizeof(QueueCounter) == 1024 + 64);

/// Takes one place for the calling thread. On a device the threads of a warp that push together take theirs with one atomic operation, so all of them must push to the
/// same queue: a queue that differs from thread to thread is to be chosen by a branch.
AMBILUX_HD uint32_t take_place(uint32_t* count) {
#if defined(__CUDA_ARCH__)
    const uint32_t together = __activemask();
    uint32_t below;
    asm("mov.u32 %0, %%lanemask_lt;" : "=r"(below));
    const uint32_t rank = uint32_t(__popc(together & below));
    uint32_t first = 0;
    // By hand, since compilers look once more for threads that add to one place.
    if (rank == 0) asm volatile("atom.global.add.u32 %0, [%1], %2;" : "=r"(first) : "l"(__cvta_generic_to_global(count)), "r"(__popc(together)) : "memory");
    return __shfl_sync(together, first, __ffs(int(together)) - 1) + rank;
#else
    return (*count)++;  // a host queue belongs to one thread
#endif
}

/// The path that an item belongs to.
template <class Item>
AMBILUX_HD uint32_t path_of(const Item& item) {
    if constexpr (requires { item.ray.path; })
        return item.ray.path;
    else if constexpr (requires { item.path; })
        return item.path;
    else
        return 0;
}

/// How the lanes of a queue's items lie in memory.
enum class LaneOrder {
    apart,     ///< lane k of item i at base[k * capacity + i]: for items that neighbouring threads take one after the other
    together,  ///< at base[i * lanes + k]: for items that are taken in no order, since memory moves 32 bytes at least
};

/// Fixed-capacity queue of trivially copyable items. A view: copies share the storage.
template <class Item, LaneOrder Order = LaneOrder::apart>
struct Queue {
    static_assert(std::is_trivially_copyable_v<Item> && sizeof(Item) % sizeof(Lane) == 0, "items are whole lanes of plain data");
    static constexpr uint32_t kLanes = sizeof(Item) / sizeof(Lane);

    Lane* base = nullptr;
    QueueCounter* counter = nullptr;
    uint32_t capacity = 0;
    uint8_t* flags = nullptr;  ///< fixed places: 1 where there is an item. Null: items are appended

    AMBILUX_HD size_t place(uint32_t i, uint32_t lane) const { return Order == LaneOrder::apart ? size_t(lane) * capacity + i : size_t(i) * kLanes + lane; }

    AMBILUX_HD Item load(uint32_t i) const {
        Lane lanes[kLanes];
        for (uint32_t k = 0; k < kLanes; ++k) lanes[k] = base[place(i, k)];
        Item item;
        memcpy(&item, lanes, sizeof(Item));
        return item;
    }
    AMBILUX_HD void store(uint32_t i, const Item& item) const {
        Lane lanes[kLanes];
        memcpy(lanes, &item, sizeof(Item));
        for (uint32_t k = 0; k < kLanes; ++k) base[place(i, k)] = lanes[k];
    }
    /// Appends the item, or stores it at the place of its path, and returns the place. Past the capacity the item is lost and counted (QueueCounter::overflow).
    AMBILUX_HD uint32_t push(const Item& item) const {
        const uint32_t i = flags ? fixed_place(item) : take_place(&counter->count);
        if (i < capacity) store(i, item);
        return i;
    }
    /// Writes the last lane of an item whose others are there already (Layout::front). Whoever does so for items that are appended sets the counter.
    template <class Last>
    AMBILUX_HD void complete(uint32_t i, const Last& last) const {
        static_assert(sizeof(Last) == sizeof(Lane));
        set_start(base[place(i, kLanes - 1)], last);
        if (!flags) return;
        flags[i] = 1;
#if !defined(__CUDA_ARCH__)
        ++counter->count;
#endif
    }

private:
    AMBILUX_HD uint32_t fixed_place(const Item& item) const {
        const uint32_t i = path_of(item);
#if !defined(__CUDA_ARCH__)
        ++counter->count;  // a device counts before it goes through the queue
        if (i >= capacity || flags[i]) ++counter->overflow;
#endif
        if (i < capacity) flags[i] = 1;
        return i;
    }
};

}  // namespace ambilux
