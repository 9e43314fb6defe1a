// One allocation for everything that a wave needs. Run once without memory it tells the bytes; run again with memory it
// hands out the places.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "queues/queue.h"
#include "queues/stage_record.h"

namespace ambilux {

class Layout {
public:
    /// The run that tells the bytes.
    Layout() = default;
    /// The run that hands out `memory`, of as many bytes as `plan` tells. Counters and records come first.
    Layout(const Layout& plan, void* memory)
        : memory_(static_cast<std::byte*>(memory)), bytes_(plan.head_bytes()),
          counters_(reinterpret_cast<QueueCounter*>(memory_)),
          records_(reinterpret_cast<StageRecord*>(memory_ + aligned(plan.names_.size() * sizeof(QueueCounter)))) {}

    /// Place for `count` values; null while there is no memory. Starts are aligned to 256 bytes, the unit of a device's
    /// memory transactions and more.
    template <class T>
    T* allocate(uint64_t count) {
        T* place = memory_ ? reinterpret_cast<T*>(memory_ + bytes_) : nullptr;
        bytes_ += aligned(count * sizeof(T));
        return place;
    }

    /// A queue without items. `by_path`: an item lies at the slot of its path; the memory must then be zero at first.
    /// `lanes`: of each item, the first ones, which are all that is used of it.
    template <class Item>
    [[gnu::cold]] Queue<Item> queue(const char* name, uint32_t capacity, bool by_path = false,
                                    uint32_t lanes = LaneArray<Item>::kLanes) {
        Queue<Item> q;
        q.counter = counters_ ? counters_ + names_.size() : nullptr;
        names_.emplace_back(name);
        capacities_.push_back(capacity);
        q.items = array<Item>(capacity, lanes);
        if (by_path) q.flags = allocate<uint8_t>(capacity);
        last_by_path_ = by_path;
        return q;
    }
    /// A queue whose items are kept over a wave, or over an iteration, and whose number is not known before. When they
    /// are too many, the wave fails and is done again with more room.
    template <class Item>
    Queue<Item> growing_queue(const char* name, uint32_t capacity, uint32_t lanes = LaneArray<Item>::kLanes) {
        growing_.push_back(names_.size());
        return queue<Item>(name, capacity, false, lanes);
    }
    template <class Item>
    LaneArray<Item> array(uint32_t capacity, uint32_t lanes = LaneArray<Item>::kLanes) {
        return {allocate<Lane>(uint64_t(capacity) * (lanes <= paired_lanes<Item>() ? (lanes + 1) / 2 * 2 : lanes)),
                capacity};
    }
    /// The same queue with other storage: never both hold items.
    template <class Item>
    Queue<Item> alternate(Queue<Item> q) {
        q.items = array<Item>(q.capacity());
        return q;
    }
    /// A queue of items that are the first lanes of those of `whole` and lie where these do.
    template <class Front, class Item>
    Queue<Front> front(const char* name, const Queue<Item>& whole) {
        static_assert(sizeof(Front) < sizeof(Item));
        const bool by_path = last_by_path_;
        Queue<Front> q = queue<Front>(name, 0);
        q.items = {whole.items.base, whole.capacity()};
        capacities_.back() = whole.capacity();
        if (by_path) q.flags = allocate<uint8_t>(whole.capacity());
        return q;
    }

    /// The record of the stage of this name; null while there is no memory.
    [[gnu::cold]] StageRecord* record(const std::string& name) {
        const size_t at = size_t(std::find(record_names_.begin(), record_names_.end(), name) - record_names_.begin());
        if (at == record_names_.size()) record_names_.push_back(name);
        return records_ ? records_ + at : nullptr;
    }

    uint64_t bytes() const { return memory_ ? bytes_ : bytes_ + head_bytes(); }
    const std::vector<std::string>& queue_names() const { return names_; }
    const std::vector<uint32_t>& queue_capacities() const { return capacities_; }
    const std::vector<std::string>& record_names() const { return record_names_; }
    QueueCounter* counters() const { return counters_; }
    StageRecord* records() const { return records_; }
    /// Places of growing queues among all.
    const std::vector<size_t>& growing() const { return growing_; }
    /// Most items that a growing queue was given, by `counters`, which lie on the host.
    uint64_t most_grown(const QueueCounter* counters) const {
        uint64_t most = 0;
        for (const size_t q : growing_) most = std::max(most, counters[q].peak);
        return most;
    }
    /// What the counters are before the first wave.
    std::vector<QueueCounter> first_counters() const {
        std::vector<QueueCounter> counters(names_.size());
        for (size_t q = 0; q < counters.size(); ++q) counters[q].capacity = capacities_[q];
        return counters;
    }

private:
    static uint64_t aligned(uint64_t bytes) { return (bytes + 255) / 256 * 256; }
    uint64_t head_bytes() const {
        return aligned(names_.size() * sizeof(QueueCounter)) + aligned(record_names_.size() * sizeof(StageRecord));
    }

    std::byte* memory_ = nullptr;
    uint64_t bytes_ = 0;
    bool last_by_path_ = false;
    QueueCounter* counters_ = nullptr;
    StageRecord* records_ = nullptr;
    std::vector<std::string> names_, record_names_;
    std::vector<uint32_t> capacities_;
    std::vector<size_t> growing_;
};

}  // namespace ambilux
