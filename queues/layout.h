// One allocation for everything that a wave needs. Run once without memory it tells the bytes; run again with memory it
// hands out the places.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "queues/queue.h"

namespace ambilux {

class Layout {
public:
    explicit Layout(void* memory = nullptr) : memory_(static_cast<std::byte*>(memory)) {}

    /// Place for `count` values; null while there is no memory. Starts are aligned to 256 bytes, the unit of a device's
    /// memory transactions and more.
    template <class T>
    T* take(uint64_t count) {
        T* place = memory_ ? reinterpret_cast<T*>(memory_ + bytes_) : nullptr;
        bytes_ += (count * sizeof(T) + 255) / 256 * 256;
        return place;
    }

    /// A queue without items. Its counter is the next of the array `counters`. With `fixed_places` an item lies at the
    /// place of its path; the memory must then be zero at first. `lanes`: of each item, the first ones, which are all
    /// that is used of it.
    template <class Item>
    Queue<Item> queue(const char* name, QueueCounter* counters, uint32_t capacity, bool fixed_places = false,
                      uint32_t lanes = Queue<Item>::kLanes) {
        Queue<Item> q;
        q.counter = counters ? counters + names_.size() : nullptr;
        q.capacity = capacity;
        names_.emplace_back(name);
        capacities_.push_back(capacity);
        q.base = take<Lane>(uint64_t(capacity) * (lanes <= paired_lanes<Item>() ? (lanes + 1) / 2 * 2 : lanes));
        if (fixed_places) q.flags = take<uint8_t>(capacity);
        return q;
    }
    /// The same queue with other storage: never both hold items.
    template <class Item>
    Queue<Item> alternate(Queue<Item> q) {
        q.base = take<Lane>(uint64_t(q.capacity) * Queue<Item>::kLanes);
        return q;
    }
    /// A queue of items that are the first lanes of those of `whole` and lie where these do.
    template <class Front, class Item>
    Queue<Front> front(const char* name, QueueCounter* counters, const Queue<Item>& whole, bool fixed_places) {
        static_assert(sizeof(Front) < sizeof(Item));
        Queue<Front> q = queue<Front>(name, counters, 0);
        q.base = whole.base;
        q.capacity = capacities_.back() = whole.capacity;
        if (fixed_places) q.flags = take<uint8_t>(q.capacity);
        return q;
    }

    uint64_t bytes() const { return bytes_; }
    const std::vector<std::string>& queue_names() const { return names_; }
    const std::vector<uint32_t>& queue_capacities() const { return capacities_; }

private:
    std::byte* memory_;
    uint64_t bytes_ = 0;
    std::vector<std::string> names_;
    std::vector<uint32_t> capacities_;
};

}  // namespace ambilux
