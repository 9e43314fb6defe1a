// What `bench queues` fills queues with and how it empties them: a stage that makes items in registers, and one that
// looks at all of every item.
#pragma once

#include <cstddef>
#include <string>
#include <type_traits>

#include "core/error.h"
#include "items/candidate_items.h"
#include "items/vertex_items.h"
#include "queues/order.h"
#include "queues/stage_record.h"

namespace ambilux {

/// Time of one operation on a queue.
struct QueueTiming {
    std::string operation;  ///< push, compact, drain, keys or sort (backends/bench_queues.h)
    std::string item;
    uint32_t bytes;  ///< of an item; keys, sort: of a key
    QueuePolicy policy;
    uint32_t one_in;         ///< of so many threads one pushes
    uint64_t looked, items;  ///< threads or places that were looked at, and items that were there
    double seconds;          ///< median of one run
};

/// Items and the sum of what they hold, whatever their order.
struct QueueContents {
    uint64_t items, sum;
};

/// Throws Error(device) if `found` is not what was `pushed`: a queue that loses items has no speed.
inline void check_contents(const std::string& item, const QueueContents& found, const QueueContents& pushed) {
    if (found.items == pushed.items && found.sum == pushed.sum) return;
    throw Error(ExitCode::device, "bench queues: of " + item + " " + std::to_string(pushed.items) +
                                      " items were pushed and " + std::to_string(found.items) + " came back" +
                                      (found.items == pushed.items ? ", but not the same" : ""));
}

/// f(name, type) for items of all sizes that renders push.
template <class Function>
void for_pushed_items(Function f) {
    f("PairItem", std::type_identity<PairItem>());
    f("ShadowItem", std::type_identity<ShadowItem>());
    f("SubpathRay", std::type_identity<SubpathRay<BidirectionalMis>>());
    f("SubpathHit", std::type_identity<HitItem<SubpathRay<BidirectionalMis>>>());
    f("ConnectionVertex", std::type_identity<ConnectionVertex<BidirectionalMis>>());
}

constexpr uint32_t kPushShares[] = {1, 2, 4, 16};  ///< one thread in so many pushes
constexpr Compaction kCompactions[] = {Compaction::atomic, Compaction::select, Compaction::none};

/// Whether renders have queues of `Item` with this compaction: vertices are always appended.
template <class Item>
constexpr bool is_compacted(Compaction compaction) {
    return compaction == Compaction::atomic || !std::is_same_v<Item, ConnectionVertex<BidirectionalMis>>;
}

/// A word that looks like any other (Wellons' "lowbias32").
AMBILUX_HD uint32_t mixed_word(uint32_t x) {
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

/// Whether thread i is one of those that push, one in 1, 2, 4 ...: not every so-manyth, so that warps differ.
AMBILUX_HD bool pushes(uint32_t i, uint32_t one_in) { return (mixed_word(i) & (one_in - 1)) == 0; }

/// Which word of an item is its path.
template <class Item>
constexpr uint32_t path_word() {
    if constexpr (requires(Item item) { item.ray.path; })
        return offsetof(Item, ray.path) / sizeof(uint32_t);
    else if constexpr (requires(Item item) { item.front.link; })
        return offsetof(Item, front.link) / sizeof(uint32_t);
    else
        return offsetof(Item, path) / sizeof(uint32_t);
}

/// An item of path i that no other path has.
template <class Item>
AMBILUX_HD Item made_item(uint32_t i) {
    constexpr uint32_t kWords = sizeof(Item) / sizeof(uint32_t);
    const uint32_t mixed = mixed_word(i);
    uint32_t words[kWords];
    for (uint32_t k = 0; k < kWords; ++k) words[k] = k == path_word<Item>() ? i : mixed + k * 0x9e3779b9u;
    Item item;
    memcpy(&item, words, sizeof(Item));
    return item;
}

/// Tells items apart by all of their words and the order of these.
template <class Item>
AMBILUX_HD uint32_t item_sum(const Item& item) {
    Lane lanes[LaneArray<Item>::kLanes];
    memcpy(lanes, &item, sizeof(Item));
    uint32_t sum = 0, factor = 1;
    for (const Lane& lane : lanes)
        for (const uint32_t w : lane.word) sum += w * factor, factor += 2;
    return mixed_word(sum);
}

/// What n threads push.
template <class Item>
QueueContents pushed_contents(uint32_t n, uint32_t one_in) {
    QueueContents c = {};
    for (uint32_t i = 0; i < n; ++i)
        if (pushes(i, one_in)) ++c.items, c.sum += item_sum(made_item<Item>(i));
    return c;
}

template <class Item>
struct PushMade {
    static constexpr const char* kName = "push";

    Queue<Item> queue;
    uint32_t one_in;
    StageRecord* record = nullptr;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (pushes(i, one_in)) queue.push(made_item<Item>(i));
    }
};

/// Adds all items to contents[0]. Unless they are `counted`, a device adds only those whose sum is 0, one of 2^32, to
/// contents[1]: too few to take time, but compilers cannot know that.
template <class Item>
struct DrainItems {
    static constexpr const char* kName = "drain";

    Queue<Item> queue;
    QueueContents* contents;
    bool counted;
    StageRecord* record = nullptr;

    const Queue<Item>& items() const { return queue; }

    AMBILUX_HD void operator()(uint32_t place) const {
        const uint32_t sum = item_sum(queue.load(place));
#if defined(__CUDA_ARCH__)
        if (!counted && sum != 0) return;
        QueueContents& c = contents[counted ? 0 : 1];
        atomicAdd(reinterpret_cast<unsigned long long*>(&c.items), 1ull);
        atomicAdd(reinterpret_cast<unsigned long long*>(&c.sum), static_cast<unsigned long long>(sum));
#else
        ++contents->items;  // a host queue belongs to one thread
        contents->sum += sum;
#endif
    }
};

}  // namespace ambilux
