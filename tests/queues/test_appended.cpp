// libs: ambilux_stages ambilux_queues
// What all waves of an iteration append to: whole parts of waves, one after the other, or nothing.
#include <algorithm>
#include <limits>
#include <numeric>
#include <thread>
#include <vector>

#include "backends/cpu/executor.h"
#include "queues/overflow.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

QueueCounter counter_of(uint32_t capacity, uint32_t count = 0) {
    QueueCounter c{};
    c.capacity = capacity;
    c.count = count;
    return c;
}

/// Notes for each item of a wave where it goes.
struct Place {
    static constexpr const char* kName = "place";

    Queue<Contribution> mine;
    QueueCounter* all;
    std::vector<uint32_t>* places;
    StageRecord* record;

    const Queue<Contribution>& items() const { return mine; }
    QueueCounter* target() const { return all; }
    void operator()(uint32_t i, uint32_t place) const {
        CHECK(i == places->size());
        places->push_back(place);
    }
};

}  // namespace

TEST_CASE("a sum goes up to a limit, for any numbers") {
    constexpr uint32_t kMost = std::numeric_limits<uint32_t>::max();
    uint32_t before = 77;
    const auto add = [&](uint32_t sum, uint32_t n, uint32_t most) {
        const uint32_t was = sum;
        const bool added = add_up_to(&sum, n, most, before);
        CHECK(sum == (added ? was + n : was));
        if (added) CHECK(before == was);
        return added;
    };
    CHECK(add(0, 0, 0));
    CHECK_FALSE(add(0, 1, 0));
    CHECK(add(3, 7, 10));
    CHECK_FALSE(add(3, 8, 10));
    CHECK(add(10, 0, 10));
    CHECK_FALSE(add(11, 0, 10));  // more than there is room for
    CHECK(add(0, kMost, kMost));
    CHECK_FALSE(add(kMost, 1, kMost));
    CHECK_FALSE(add(kMost - 5, 6, kMost));
    CHECK_FALSE(add(6, kMost - 5, kMost));  // the sum would not fit 32 bits
}

TEST_CASE("waves append from many threads: what has room lies one after the other, what has none leaves nothing") {
    constexpr uint32_t kThreads = 7, kWaves = 2000;
    struct Part {
        uint32_t begin, size;
    };
    for (const uint32_t capacity : {0u, 1u, 1000u, 40'000u, 1u << 20}) {
        INFO("room for " << capacity);
        QueueCounter all = counter_of(capacity);
        std::vector<uint32_t> owner(capacity, kNone);
        std::vector<Part> done[kThreads];
        uint32_t refused[kThreads] = {}, largest[kThreads] = {}, wrong[kThreads] = {};
        std::vector<std::thread> threads;
        for (uint32_t t = 0; t < kThreads; ++t)
            threads.emplace_back([&, t] {
                for (uint32_t w = 0; w < kWaves; ++w) {
                    const uint32_t items = (w * 31 + t * 17) % 41;
                    WaveState state{};
                    state.samples = 3;
                    QueueCounter mine = counter_of(64, items);
                    reserve_appended(state, mine, all);
                    if (state.failed) {
                        wrong[t] += state.failed != kAppendedFull || state.samples != 0 || mine.count != 0;
                        wrong[t] += items == 0 || mine.peak != items;
                        ++refused[t];
                        largest[t] = std::max(largest[t], items);
                        continue;
                    }
                    wrong[t] += state.samples != 3 || mine.count != items;
                    done[t].push_back({state.appended, items});
                    for (uint32_t i = 0; i < items; ++i) owner[state.appended + i] = t * kWaves + w;
                }
            });
        for (std::thread& thread : threads) thread.join();
        CHECK(std::accumulate(wrong, wrong + kThreads, 0u) == 0);
        std::vector<Part> parts;
        for (const std::vector<Part>& of_thread : done) parts.insert(parts.end(), of_thread.begin(), of_thread.end());
        std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
            return a.begin != b.begin ? a.begin < b.begin : a.size < b.size;
        });
        uint32_t end = 0;
        for (const Part& p : parts) {
            if (p.begin != end) FAIL_CHECK("a part begins at " << p.begin << ", the one before ends at " << end);
            end = p.begin + p.size;
        }
        CHECK(all.count == end);
        CHECK(end <= capacity);
        for (uint32_t i = 0; i < end; ++i)
            if (owner[i] == kNone) FAIL_CHECK("nobody wrote place " << i);
        // Room is refused only where there is none, and the peak tells of the largest wave that was refused.
        const uint32_t most = *std::max_element(largest, largest + kThreads);
        const bool some = std::any_of(refused, refused + kThreads, [](uint32_t n) { return n > 0; });
        CHECK(some == (capacity < 1u << 18));
        CHECK(all.peak == (some ? uint64_t(capacity) + most : 0));
        if (some) CHECK(end + most > capacity);
        CHECK(all.overflow == 0);
    }
}

TEST_CASE("an executor appends the items of a wave in order, and empties what belongs to a wave that failed") {
    QueueCounter all = counter_of(10, 4), mine = counter_of(8, 6), other = counter_of(8, 5);
    const Queue<Contribution> queue = {{nullptr, 8}, &mine}, splats = {{nullptr, 8}, &other};
    std::vector<uint32_t> places;
    StageRecord record{};
    const Place place = {queue, &all, &places, &record};
    WaveState state{};
    state.samples = 1;
    CpuExecutor exec(&state);
    exec.append(place, splats);
    CHECK(places == std::vector<uint32_t>{4, 5, 6, 7, 8, 9});
    CHECK(state.failed == kNoFailure);
    CHECK(mine.count == 6);
    CHECK(other.count == 5);
    CHECK(all.count == 10);
    CHECK(record.items == 6);

    places.clear();
    exec.append(place, splats);
    CHECK(places.empty());
    CHECK(state.failed == kAppendedFull);
    CHECK(mine.count == 0);
    CHECK(other.count == 0);
    CHECK(all.count == 10);
    CHECK(all.peak == 16);
    CHECK(record.items == 6);
}

TEST_CASE("a wave that failed before appends nothing, whatever its queues hold") {
    QueueCounter all = counter_of(100, 4), mine = counter_of(8, 6), full = counter_of(2, 3);
    std::vector<uint32_t> places;
    StageRecord record{};
    WaveState state{};
    state.samples = 1;
    CpuExecutor exec(&state);
    const Queue<Contribution> queue = {{nullptr, 8}, &mine}, other = {{nullptr, 2}, &full};
    exec.fail_on_overflow(other, other);
    REQUIRE(state.failed == kQueuesFull);
    exec.append(Place{queue, &all, &places, &record});
    CHECK(places.empty());
    CHECK(state.failed == kQueuesFull);
    CHECK(mine.count == 0);
    CHECK(all.count == 4);
    CHECK(all.peak == 0);
}
