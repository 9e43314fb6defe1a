// Where a stage puts what it makes.
#pragma once

#include "queues/queue.h"

namespace ambilux {

/// The queue of the stage `Next`, or, if `through`, that stage itself: items that are made and used up by neighbouring
/// stages, one for one, need not go through memory. `Next` has take(item), which is all that it does with an item of
/// its queue, and returns the place to which it pushes, or 0.
template <class Item, class Next>
struct Outlet {
    Queue<Item> queue;
    Next next;
    bool through;

    /// The place where the item, or what `Next` made of it, has gone in a queue; 0 too if it has not.
    AMBILUX_HD uint32_t push(const Item& item) const { return through ? next.take(item) : queue.push(item); }
};

/// A queue, or on a host, if `take` is set, a stage of any kind that has each item at once: nothing waits there for
/// many items to come together.
template <class Item>
struct HostOutlet {
    Queue<Item> queue;
    const void* stage = nullptr;
    void (*take)(const void* stage, const Item& item) = nullptr;

    /// The place in the queue; 0 too if there is none.
    AMBILUX_HD uint32_t push(const Item& item) const {
#if !defined(__CUDA_ARCH__)
        if (take) return take(stage, item), 0;
#endif
        return queue.push(item);
    }
};

}  // namespace ambilux
