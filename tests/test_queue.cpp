// libs: ambilux_queues
// Queues on the host: storage, counting, layout.
#include <memory>
#include <set>
#include <vector>

#include "queues/layout.h"
#include "tests/catch.h"

using namespace ambilux;

namespace {

struct Item {
    uint32_t word[12];
};

Item numbered(uint32_t i) {
    Item item;
    for (uint32_t k = 0; k < 12; ++k) item.word[k] = i * 12 + k;
    return item;
}

/// A queue of the given capacity with its memory.
struct OwnedQueue {
    std::vector<Lane> memory;
    QueueCounter counter{};
    Queue<Item> queue;

    explicit OwnedQueue(uint32_t capacity) : memory(size_t(capacity) * Queue<Item>::kLanes + 1) {
        counter.capacity = capacity;
        queue = {memory.data(), &counter, capacity};
    }
};

}  // namespace

TEST_CASE("queue: what is pushed is loaded, for any size") {
    for (const uint32_t n : {0u, 1u, 31u, 32u, 33u, 1000u, (1u << 20) + 1}) {
        OwnedQueue q(n);
        for (uint32_t i = 0; i < n; ++i) q.queue.push(numbered(i));
        REQUIRE(q.counter.size() == n);
        uint64_t wrong = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const Item item = q.queue.load(i);
            for (uint32_t k = 0; k < 12; ++k) wrong += item.word[k] != i * 12 + k;
        }
        CHECK(wrong == 0);
    }
}

TEST_CASE("queue: lanes of an item lie a capacity apart, so that neighbours are adjacent in memory") {
    OwnedQueue q(7);
    for (uint32_t i = 0; i < 7; ++i) q.queue.push(numbered(i));
    for (uint32_t i = 0; i < 7; ++i)
        for (uint32_t lane = 0; lane < 3; ++lane) CHECK(q.memory[lane * 7 + i].word[0] == i * 12 + lane * 4);
}

TEST_CASE("G3: a push past the capacity is counted, and touches nothing") {
    OwnedQueue q(5);
    q.memory.back().word[0] = 0xabcdu;
    for (uint32_t i = 0; i < 9; ++i) q.queue.push(numbered(i));
    CHECK(q.counter.size() == 5);
    CHECK(q.memory.back().word[0] == 0xabcdu);
    for (uint32_t i = 0; i < 5; ++i) CHECK(q.queue.load(i).word[11] == i * 12 + 11);
    q.counter.finish();
    CHECK(q.counter.overflow == 4);
    CHECK(q.counter.peak == 9);
    CHECK(q.counter.size() == 0);
    q.queue.push(numbered(1));
    q.counter.finish();
    CHECK(q.counter.overflow == 4);
    CHECK(q.counter.peak == 9);
}

TEST_CASE("G8: a layout without memory tells the bytes that one with memory uses") {
    const auto lay = [](Layout& layout, QueueCounter* counters) {
        std::vector<const void*> places;
        places.push_back(layout.take<uint32_t>(3));
        for (const uint32_t n : {0u, 1u, 100u, 4097u}) places.push_back(layout.queue<Item>("q", counters, n).base);
        places.push_back(layout.take<double>(7));
        return places;
    };
    Layout dry;
    lay(dry, nullptr);
    std::vector<Lane> memory(dry.bytes() / sizeof(Lane) + 16);
    void* start = memory.data();
    size_t space = memory.size() * sizeof(Lane);
    start = std::align(256, dry.bytes(), start, space);
    QueueCounter counters[4] = {};
    Layout real(start);
    const auto places = lay(real, counters);
    CHECK(real.bytes() == dry.bytes());
    CHECK(real.queue_names().size() == 4);
    CHECK(real.queue_capacities() == std::vector<uint32_t>{0, 1, 100, 4097});
    for (const void* p : places) CHECK(reinterpret_cast<uintptr_t>(p) % 256 == 0);
    // Only the empty queue may share its place.
    CHECK(std::set<const void*>(places.begin(), places.end()).size() == places.size() - 1);
}
