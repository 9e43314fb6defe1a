// libs: ambilux_backends ambilux_queues ambilux_core
// seconds: 5
// Sorts and scans of a host: those of the standard library, to the byte, on any number of threads.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <chrono>

#include "backends/cpu/executor.h"
#include "backends/cpu/host_memory.h"
#include "backends/cpu/whole_executor.h"
#include "tests/support/catch.h"
#include "tests/support/primitive_cases.h"

using namespace ambilux;

namespace {

constexpr uint32_t kSmall[] = {0, 1, 2, 31, 32, 33, 255, 256, 257, 1000, 4095, 4096, 4097}, kLarge = (1u << 20) + 1;

/// Calls f() on 1, 2 and 7 threads.
template <class Function>
void on_threads(const Function& f) {
    const tbb::global_control most(tbb::global_control::max_allowed_parallelism, 7);
    for (const int threads : {1, 2, 7}) {
        INFO(threads << " threads");
        tbb::task_arena arena(threads);
        arena.execute(f);
    }
}

template <class Key>
void check_sorts(uint32_t n) {
    test::for_sort_cases<Key>(n, host_primitive_bytes(), [](const std::string& what, const test::SortCase<Key>& c) {
        INFO(what);
        std::vector<std::byte> alone = c.before();
        sort_pairs_alone(c.place(alone.data()), c.size(), c.bits);
        CHECK(c.sorted(alone));
        on_threads([&] {
            std::vector<std::byte> together = c.before();
            sort_pairs_together(c.place(together.data()), c.size(), c.bits);
            CHECK(c.sorted(together));
        });
    });
}

}  // namespace

TEST_CASE("sorts of pairs: stable, by the bits that are asked for, on any number of threads, and no byte beyond") {
    for (const uint32_t n : kSmall) {
        check_sorts<uint16_t>(n);
        check_sorts<uint32_t>(n);
        check_sorts<uint64_t>(n);
    }
    // Of many pairs, one sort of each kind: ties everywhere, and none.
    const auto sort_many = [](const auto& keys, uint32_t bits) {
        using Key = std::decay_t<decltype(keys[0])>;
        const test::SortCase<Key> c{keys, bits, host_primitive_bytes()};
        std::vector<std::byte> alone = c.before();
        sort_pairs_alone(c.place(alone.data()), c.size(), c.bits);
        CHECK(c.sorted(alone));
        on_threads([&] {
            std::vector<std::byte> together = c.before();
            sort_pairs_together(c.place(together.data()), c.size(), c.bits);
            CHECK(c.sorted(together));
        });
    };
    sort_many(test::scrambled_keys<uint16_t>(kLarge), 16);
    sort_many(test::scrambled_keys<uint32_t>(kLarge), 3);
    sort_many(test::scrambled_keys<uint64_t>(kLarge), 64);
}

TEST_CASE("scans: sums of what comes before, in place too, on any number of threads, and no number beyond") {
    std::vector<uint32_t> sizes(std::begin(kSmall), std::end(kSmall));
    for (const uint32_t n : {8191u, 8193u, 100'000u, kLarge}) sizes.push_back(n);
    for (const uint32_t n : sizes) {
        INFO(n << " numbers");
        std::vector<uint32_t> numbers = test::numbers_to_sum(n), sums = test::sums_before(numbers);
        for (std::vector<uint32_t>* guarded : {&numbers, &sums}) guarded->insert(guarded->end(), 3, 0xa5a5a5a5u);
        on_threads([&] {
            std::vector<uint32_t> in = numbers, out(n + 3, 0xa5a5a5a5u);
            scan_together(in.data(), out.data(), n);
            CHECK(in == numbers);
            CHECK(out == sums);
            scan_together(in.data(), in.data(), n);
            CHECK(in == sums);
        });
    }
}

TEST_CASE("executors of a host sort as many pairs as a queue has, and no more than it holds") {
    for (const uint32_t pushed : {0u, 1u, 100u, 105u, 200u}) {
        INFO(pushed << " pushes");
        const uint32_t n = std::min(pushed, 105u);
        const test::SortCase<uint32_t> c{test::scrambled_keys<uint32_t>(n), 7, host_primitive_bytes(), 105};
        QueueCounter counter{};
        counter.count = pushed;
        counter.capacity = 105;
        const Queue<Contribution> queue = {{nullptr, 105}, &counter};
        StageRecord record{};
        std::vector<std::byte> memory = c.before();
        WaveState state{};
        CpuExecutor(&state).sort_pairs(c.place(memory.data()), queue, c.bits, &record);
        CHECK(c.sorted(memory));
        memory = c.before();
        CpuWholeExecutor whole;
        CHECK(whole.count(queue) == n);
        whole.sort_pairs(c.place(memory.data()), whole.count(queue), c.bits, &record);
        CHECK(c.sorted(memory));
        CHECK(counter.count == pushed);
        whole.clear(queue);
        CHECK(counter.count == 0);
        CHECK(counter.peak == pushed);
    }
}

namespace {

/// Drops a few numbers of each kind.
struct Visit {
    std::atomic<uint32_t>* visits;
    StageRecord* record;

    void operator()(uint32_t i) const {
        ++visits[i];
        record->nan += i % 100 == 7;
        record->inf += i % 200 == 8;
        record->negative += i % 300 == 9;
        record->underflow += i % 400 == 310;
    }
};

/// Nanoseconds of f() by a clock around it.
template <class Function>
uint64_t nanoseconds_around(const Function& f) {
    const auto start = std::chrono::steady_clock::now();
    f();
    return uint64_t(std::chrono::nanoseconds(std::chrono::steady_clock::now() - start).count());
}

}  // namespace

TEST_CASE("a stage between phases sees every number once, and its record tells items, losses and time of one launch") {
    CpuWholeExecutor whole;
    for (const uint32_t n : {0u, 1u, 63u, 64u, 65u, 1000u})
        on_threads([&] {
            CAPTURE(n);
            QueueCounter counter{};
            counter.count = 2 * n;
            counter.capacity = n;
            const Queue<Contribution> queue = {{nullptr, n}, &counter};
            StageRecord record{};
            std::vector<std::atomic<uint32_t>> visits(n + 1);
            const Visit visit = {visits.data(), &record};
            uint64_t most = nanoseconds_around([&] { whole.for_each(visit, n); });
            CHECK(record.launches == 1);
            CHECK(record.items == n);
            CHECK(record.items_by_depth[0] == n);
            CHECK(record.nanoseconds <= most);
            if (n > 0) CHECK(record.nanoseconds > 0);
            CHECK(record.nan == (n + 92) / 100);
            CHECK(record.inf == (n + 191) / 200);
            CHECK(record.negative == (n + 290) / 300);
            CHECK(record.underflow == (n + 89) / 400);
            most += nanoseconds_around([&] { whole.for_each(visit, queue); });
            if (n % 5 == 0) most += nanoseconds_around([&] { whole.run_slots(visit, n / 5, 5); });
            const uint32_t times = n % 5 == 0 ? 3 : 2;
            CHECK(record.launches == times);
            CHECK(record.items == times * n);
            CHECK(record.nanoseconds <= most);
            CHECK(counter.count == 2 * n);
            for (uint32_t i = 0; i < n; ++i)
                if (visits[i] != times) FAIL(i << " was visited " << visits[i] << " times");
            CHECK(visits[n] == 0);
        });
}

TEST_CASE("sorts and scans between phases add their time to a record, and nothing else") {
    constexpr uint32_t kCount = 10'000;
    CpuWholeExecutor whole;
    StageRecord record{};
    record.nanoseconds = 1'000'000'000'000;
    std::vector<uint32_t> numbers = test::numbers_to_sum(kCount), sums(kCount);
    uint64_t most = nanoseconds_around([&] { whole.scan({}, numbers.data(), sums.data(), kCount, &record); });
    CHECK(sums == test::sums_before(numbers));
    CHECK(record.nanoseconds > 1'000'000'000'000);
    CHECK(record.nanoseconds <= 1'000'000'000'000 + most);
    const test::SortCase<uint32_t> c{test::scrambled_keys<uint32_t>(kCount), 32, host_primitive_bytes()};
    std::vector<std::byte> memory = c.before();
    const uint64_t before = record.nanoseconds;
    most = nanoseconds_around([&] { whole.sort_pairs(c.place(memory.data()), c.size(), c.bits, &record); });
    CHECK(c.sorted(memory));
    CHECK(record.nanoseconds > before);
    CHECK(record.nanoseconds <= before + most);
    CHECK(record.launches == 0);
    CHECK(record.items == 0);
}

TEST_CASE("Memory of a host lies where queues want it, is zero at first, and is copied byte by byte") {
    for (const uint64_t bytes : {1, 255, 256, 1000}) {
        HostMemory memory(bytes);
        CHECK(memory.bytes() == bytes);
        CHECK(reinterpret_cast<uintptr_t>(memory.data()) % 256 == 0);
        CHECK(std::all_of(memory.data(), memory.data() + bytes, [](std::byte b) { return b == std::byte{0}; }));
    }
    HostMemory memory(4);
    const char text[] = {'a', 'b', 'c', 'd'};
    char back[4] = {};
    HostMemory::put(memory.data(), text, 3);
    HostMemory::copy(memory.data() + 3, memory.data(), 1);
    HostMemory::get(back, memory.data(), 4);
    CHECK(std::string(back, 4) == "abca");
    HostMemory::clear(memory.data() + 1, 2);
    HostMemory::get(back, memory.data(), 4);
    CHECK(std::string(back, 4) == std::string("a\0\0a", 4));
    HostMemory::clear(memory.data() + 3, 1);
    HostMemory::put(memory.data() + 1, text + 2, 1);
    HostMemory::get(back, memory.data(), 4);
    CHECK(std::string(back, 4) == std::string("ac\0\0", 4));
    for (const auto nothing : {&HostMemory::put, &HostMemory::get, &HostMemory::copy}) nothing(nullptr, nullptr, 0);
    HostMemory::clear(nullptr, 0);
    CHECK(HostMemory().bytes() == 0);
}
