// Work queues: items that stages push, and a counter that lives where the kernels run.
#pragma once

#include "queues/counter.h"
#include "queues/lane_array.h"

namespace ambilux {

/// The path that an item belongs to.
template <class Item>
AMBILUX_HD uint32_t path_of(const Item& item) {
    if constexpr (requires { item.ray.path; })
        return item.ray.path;
    else if constexpr (requires { item.path; })
        return item.path;
    else if constexpr (requires { item.path(); })
        return item.path();
    else
        return 0;
}

/// Queue of fixed capacity. Items are appended, or lie at the slots of their paths (queues/order.h says what for). A
/// view: copies share the storage.
template <class Item>
struct Queue {
    using value_type = Item;

    LaneArray<Item> items;
    QueueCounter* counter = nullptr;
    uint8_t* flags = nullptr;  ///< by path: 1 where there is an item. Null: items are appended
    uint16_t* keys = nullptr;  ///< by slot: what items are sorted by (queues/order.h), written by those who complete
                               ///< them. Null: looked up when they are sorted

    AMBILUX_HD uint32_t capacity() const { return items.capacity; }
    AMBILUX_HD Item load(uint32_t i) const { return items.load(i); }
    AMBILUX_HD void store(uint32_t i, const Item& item) const { items.store(i, item); }

    /// Appends the item, or stores it at the slot of its path, and returns the slot. Past the capacity the item is lost
    /// and counted (QueueCounter::overflow). `lanes`: of the item, those that are stored.
    AMBILUX_HD uint32_t push(const Item& item, uint32_t lanes = LaneArray<Item>::kLanes) const {
        uint32_t i;
        if (flags)
            occupy(i = path_of(item));
        else
            i = allocate_slot(&counter->count);
        if (i < items.capacity) items.store(i, item, lanes);
        return i;
    }
    /// Stores the item at slot `i` of a queue that is not appended to, whatever its path.
    AMBILUX_HD void put(uint32_t i, const Item& item) const {
        occupy(i);
        items.store(i, item);
    }
    /// Writes the last lane of an item whose others are there already (Layout::front). Whoever does so for items that
    /// are appended sets the counter.
    template <class Last>
    AMBILUX_HD void complete(uint32_t i, const Last& last) const {
        items.store_last(i, last);
        if (!flags) return;
        flags[i] = 1;
#if !defined(__CUDA_ARCH__)
        ++counter->count;
#endif
    }

private:
    AMBILUX_HD void occupy(uint32_t i) const {
#if !defined(__CUDA_ARCH__)
        ++counter->count;  // a device counts before it goes through the queue
        if (i >= items.capacity || flags[i]) ++counter->overflow;
#endif
        if (i < items.capacity) flags[i] = 1;
    }
};

}  // namespace ambilux
