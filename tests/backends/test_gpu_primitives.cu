// libs: ambilux_backends ambilux_queues ambilux_core
// labels: gpu
// Sorts, scans and appends of a device: those of a host, to the byte, over numbers that the host knows and over queues
// whose size only the device knows, in a graph and kernel by kernel.
#include "backends/cuda/executor.cuh"
#include "backends/cuda/handles.h"
#include "backends/cuda_device.h"
#include "items/candidate_items.h"
#include "tests/support/catch.h"
#include "tests/support/primitive_cases.h"
#include "tests/support/skip.h"

using namespace ambilux;

namespace {

bool no_device() {
    if (cuda_device_present()) return false;
    skip("no CUDA device: skipped");
    return true;
}

/// An executor with all that it works on.
struct OwnExecutor {
    Owned<cudaStream_t> stream = make_stream();
    DeviceBuffer<WaveState> state{1};
    DeviceBuffer<StageRecord> record{1};
    DeviceBuffer<uint64_t> clock{1};
    CudaExecutor<false> exec{stream.get(), {}, state.data(), clock.data(), SceneView{}, OrderMemory{}};

    OwnExecutor() {
        state.zero();
        record.zero();
        clock.zero();
        cuda_check(cudaDeviceSynchronize(), "executor");
    }
    void wait() { cuda_check(cudaStreamSynchronize(stream.get()), "primitives"); }
};

/// Counters of queues, `count` items of `capacity` in each.
std::vector<QueueCounter> counters_of(std::initializer_list<std::pair<uint32_t, uint32_t>> counts_and_capacities) {
    std::vector<QueueCounter> counters;
    for (const auto& [count, capacity] : counts_and_capacities) {
        counters.emplace_back();
        counters.back().count = count;
        counters.back().capacity = capacity;
    }
    return counters;
}

template <class Key>
void check_sorts(uint32_t n) {
    OwnExecutor own;
    test::for_sort_cases<Key>(n, device_primitive_bytes(), [&](const std::string& what, const test::SortCase<Key>& c) {
        INFO(what);
        const std::vector<std::byte> before = c.before();
        DeviceBuffer<std::byte> memory{std::span<const std::byte>(before)};
        own.exec.sort_pairs(c.place(memory.data()), n, c.bits, own.record.data());
        own.wait();
        CHECK(c.sorted(memory.download()));
    });
}

}  // namespace

TEST_CASE("sorts of a device: stable, by the bits that are asked for, and no byte beyond") {
    if (no_device()) return;
    for (const uint32_t n : {0u, 1u, 2u, 31u, 32u, 33u, 1000u, 4095u, 4097u}) {
        check_sorts<uint16_t>(n);
        check_sorts<uint32_t>(n);
        check_sorts<uint64_t>(n);
    }
    check_sorts<uint64_t>((1u << 20) + 1);
}

TEST_CASE("scans of a device: sums of what comes before, in place too, and no number beyond") {
    if (no_device()) return;
    OwnExecutor own;
    for (const uint32_t n : {0u, 1u, 31u, 32u, 33u, 1000u, 4097u, (1u << 20) + 1}) {
        INFO(n << " numbers");
        std::vector<uint32_t> numbers = test::numbers_to_sum(n), sums = test::sums_before(numbers);
        for (std::vector<uint32_t>* guarded : {&numbers, &sums}) guarded->insert(guarded->end(), 3, 0xa5a5a5a5u);
        const uint64_t bytes = device_primitive_bytes().scan(n);
        DeviceBuffer<std::byte> temporary(bytes);
        DeviceBuffer<uint32_t> in{std::span<const uint32_t>(numbers)},
            out{std::span<const uint32_t>(std::vector<uint32_t>(n + 3, 0xa5a5a5a5u))};
        const ScanMemory memory = {temporary.data(), bytes};
        own.exec.scan(memory, in.data(), out.data(), n, own.record.data());
        own.wait();
        CHECK(in.download() == numbers);
        CHECK(out.download() == sums);
        own.exec.scan(memory, in.data(), in.data(), n, own.record.data());
        own.wait();
        CHECK(in.download() == sums);
    }
}

namespace {

/// One graph, and launches kernel by kernel, for all sizes of a queue of `capacity`.
template <class Key>
void check_queue_sorts(uint32_t capacity, uint32_t bits) {
    OwnExecutor own;
    const Key last = Key(bits < 8 * sizeof(Key) ? (Key(1) << bits) - 1 : ~Key(0));
    const auto case_of = [&](uint32_t n) {
        test::SortCase<Key> c{test::scrambled_keys<Key>(n), bits, device_primitive_bytes(), capacity};
        for (Key& key : c.keys)
            if ((key & last) == last) key = Key(key ^ 1);  // the last key is that of pairs past the last
        return c;
    };
    DeviceBuffer<std::byte> memory(case_of(0).bytes());
    DeviceBuffer<QueueCounter> counter(1);
    const Queue<Contribution> queue = {{nullptr, capacity}, counter.data()};
    const SortMemory<Key> places = case_of(0).place(memory.data());
    const auto sort = [&](auto& exec) { exec.sort_pairs(places, queue, bits, own.record.data()); };
    const Owned<cudaGraphExec_t> graph = own.exec.capture(sort);
    for (const uint32_t pushed : {capacity, 0u, 1u, 2u, 31u, 32u, 33u, capacity / 4, capacity / 4 + 1, capacity / 2,
                                  capacity / 2 + 1, capacity - 1, capacity + 100}) {
        const uint32_t n = std::min(pushed, capacity);
        const test::SortCase<Key> c = case_of(n);
        for (const bool in_graph : {true, false}) {
            INFO(pushed << " of " << capacity << " keys of " << 8 * sizeof(Key) << " bits, sorted by " << bits
                        << ", in a graph " << in_graph);
            memory.upload(c.before());
            counter.upload(counters_of({{pushed, capacity}}));
            if (in_graph)
                cuda_check(cudaGraphLaunch(graph.get(), own.stream.get()), "graph");
            else
                own.exec.launch(sort);
            own.wait();
            CHECK(c.sorted(memory.download(), true));
            CHECK(counter.download()[0].count == pushed);
        }
    }
}

}  // namespace

TEST_CASE("sorts of as many pairs as a queue has, which only the device knows: in a graph and kernel by kernel") {
    if (no_device()) return;
    for (const uint32_t capacity : {64u, 5000u, 8192u}) {
        check_queue_sorts<uint16_t>(capacity, 9);
        check_queue_sorts<uint16_t>(capacity, 16);
        check_queue_sorts<uint32_t>(capacity, 24);
        check_queue_sorts<uint64_t>(capacity, 3);
        check_queue_sorts<uint64_t>(capacity, 64);
    }
}

namespace {

/// Writes for each item of a wave where it lies among those of all.
struct Place {
    static constexpr const char* kName = "place";

    Queue<Contribution> mine;
    QueueCounter* all;
    uint32_t* owner;  ///< by place: wave and item
    const uint32_t* wave;
    StageRecord* record;

    AMBILUX_HD const Queue<Contribution>& items() const { return mine; }
    AMBILUX_HD QueueCounter* target() const { return all; }
    AMBILUX_HD void operator()(uint32_t i, uint32_t place) const { owner[place] = *wave << 16 | i; }
};

}  // namespace

TEST_CASE("appends of a device: whole waves one after the other; one that has no room leaves nothing") {
    if (no_device()) return;
    constexpr uint32_t kRoom = 1000, kMine = 600, kWaves[] = {0, 1, 300, 0, 600, 99, 1, 33, 0};
    for (const bool in_graph : {true, false}) {
        INFO("in a graph " << in_graph);
        OwnExecutor own;
        // What all waves append to, a wave's own, another queue that is the wave's.
        DeviceBuffer<QueueCounter> counters{
            std::span<const QueueCounter>(counters_of({{0, kRoom}, {0, kMine}, {0, 8}}))};
        DeviceBuffer<uint32_t> owner{std::span<const uint32_t>(std::vector<uint32_t>(kRoom + 50, kNone))}, wave(1);
        const Queue<Contribution> mine = {{nullptr, kMine}, counters.data() + 1},
                                  other = {{nullptr, 8}, counters.data() + 2};
        const auto append = [&](auto& exec) {
            exec.append(Place{mine, counters.data(), owner.data(), wave.data(), own.record.data()}, other);
        };
        own.exec.expect_no_failure();
        const Owned<cudaGraphExec_t> graph = own.exec.capture(append);
        CHECK(own.exec.may_fail());
        std::vector<uint32_t> expected(kRoom + 50, kNone);
        uint32_t end = 0, items_done = 0;
        for (uint32_t w = 0; w < std::size(kWaves); ++w) {
            INFO("wave " << w << " of " << kWaves[w] << " items, " << end << " before it");
            const bool fits = end + kWaves[w] <= kRoom;
            std::vector<QueueCounter> before = counters.download();
            before[1].count = kWaves[w];
            before[2].count = 5;
            counters.upload(before);
            wave.upload(std::vector<uint32_t>{w});
            std::vector<WaveState> state(1);
            state[0].samples = 1;
            own.state.upload(state);
            if (in_graph)
                cuda_check(cudaGraphLaunch(graph.get(), own.stream.get()), "graph");
            else
                own.exec.launch(append);
            own.wait();
            state = own.state.download();
            const std::vector<QueueCounter> after = counters.download();
            CHECK(state[0].failed == (fits ? kNoFailure : kAppendedFull));
            CHECK(state[0].samples == (fits ? 1 : 0));
            CHECK(after[1].count == (fits ? kWaves[w] : 0));
            CHECK(after[2].count == (fits ? 5 : 0));
            for (uint32_t i = 0; fits && i < kWaves[w]; ++i) expected[end + i] = w << 16 | i;
            if (fits) end += kWaves[w], items_done += kWaves[w];
            CHECK(after[0].count == end);
            if (!fits) CHECK(after[0].peak == kRoom + kWaves[w]);
        }
        CHECK(end == kRoom);
        CHECK(owner.download() == expected);
        CHECK(own.record.download()[0].items == items_done);
        CHECK(own.exec.count(Queue<Contribution>{{nullptr, kRoom}, counters.data()}) == kRoom);
        CHECK(own.exec.count(other) == 5);
    }
}
