// Where a stage puts what it makes.
#pragma once

#include "queues/queue.h"

namespace ambilux {

/// The queue of the stage `Next`, or, if `through`, that stage itself: items that are made and used up by neighbouring stages, one for one, need not go through memory.
/// `Next` has take(item), which is all that it does with an item of its queue.
template <class Item, class Next>
struct Outlet {
    Queue<Item> queue;
    Next next;
    bool through;

    AMBILUX_HD void push(const Item& item) const {
        if (through)
            next.take(item);
        else
            queue.push(item);
    }
};

/// A queue, or on a host, if `take` is set, a stage of any kind that has each item at once: nothing waits there for many items to come together.
template <class Item>
struct HostOutlet {
    Queue<Item> queue;
    const void* stage = nullptr;
    void (*take)(const void* stage, const Item& item) = nullptr;

    AMBILUX_HD void push(const Item& item) const {
#if !defined(__CUDA_ARCH__)
        if (take) return take(stage, item);
#endif
        queue.push(item);
    }
};

}  // namespace ambilux
