// libs: ambilux_backends ambilux_formats ambilux_accel ambilux_queues ambilux_core
// labels: gpu
// Queues on a device: pushes of divergent threads, warp by warp; lists of places.
#include <algorithm>
#include <numeric>
#include <vector>

#include "backends/bench_queue_stages.h"
#include "backends/bench_queues.h"
#include "backends/cuda/device_memory.h"
#include "backends/cuda/executor.cuh"
#include "backends/cuda/order.h"
#include "backends/cuda_device.h"
#include "items/subpath_items.h"
#include "queues/reserved_queue.h"
#include "tests/support/render_scene.h"
#include "tests/support/skip.h"

using namespace ambilux;

namespace {

struct Item {
    uint32_t word[8];
};

/// Threads that `keep` selects push their number.
__global__ void push_some(Queue<Item> queue, uint32_t n, uint32_t keep) {
    const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= n) return;
    // Two places that push, so that warps diverge.
    if (i % keep == 0)
        queue.push({{i, 0, 0, 0, 0, 0, 0, i}});
    else if (keep == 3 && i % keep == 1)
        queue.push({{i, 0, 0, 0, 0, 0, 0, i}});
}

}  // namespace

TEST_CASE("queue on a device: every push arrives once, for any size and divergence") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    for (const uint32_t n : {1u, 31u, 32u, 33u, 1000u, (1u << 20) + 1}) {
        for (const uint32_t keep : {1u, 2u, 3u, 33u}) {
            const uint32_t expected = keep == 3 ? (n + 2) / 3 + (n + 1) / 3 : (n + keep - 1) / keep;
            const uint32_t capacity = std::max(1u, expected);
            DeviceBuffer<Lane> memory(size_t(capacity) * 2);
            std::vector<QueueCounter> counters(1);
            counters[0].capacity = capacity;
            DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
            push_some<<<(n + 127) / 128, 128>>>(Queue<Item>{{memory.data(), capacity}, counter.data()}, n, keep);
            cuda_check(cudaDeviceSynchronize(), "push_some");
            REQUIRE(counter.download()[0].count == expected);
            const std::vector<Lane> lanes = memory.download();
            std::vector<uint32_t> seen;
            bool whole = true;
            for (uint32_t i = 0; i < expected; ++i) {
                seen.push_back(lanes[i].word[0]);
                whole &= lanes[i].word[0] == lanes[capacity + i].word[3];
            }
            CHECK(whole);
            std::sort(seen.begin(), seen.end());
            uint64_t wrong = 0;
            for (uint32_t i = 0, k = 0; i < n; ++i)
                if (i % keep == 0 || (keep == 3 && i % keep == 1)) wrong += seen[k++] != i;
            CHECK(wrong == 0);
        }
    }
}

TEST_CASE("G3: a full queue on a device loses items by count, not in silence") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    DeviceBuffer<Lane> memory(200);
    std::vector<QueueCounter> counters(1);
    counters[0].capacity = 100;
    DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
    push_some<<<8, 128>>>(Queue<Item>{{memory.data(), 100}, counter.data()}, 1000, 1);
    cuda_check(cudaDeviceSynchronize(), "push_some");
    QueueCounter c = counter.download()[0];
    CHECK(c.count == 1000);
    CHECK(c.size() == 100);
    c.finish();
    CHECK(c.overflow == 900);
}

namespace {

/// An item of two lanes, as those whose slots are reserved ahead.
struct Reserved {
    uint32_t number, pad[2], path;
    uint32_t again[4];
};

/// Threads that `keep` selects push their number, from one of two places.
__global__ void __launch_bounds__(128) push_reserved(ReservedQueue<Reserved> queue, uint32_t n, uint32_t keep) {
    ReservedSlots& slots = ReservedSlots::of_block();
    slots.open(n);
    for (uint32_t i = blockIdx.x * 128 + threadIdx.x; i < n; i += gridDim.x * 128) {
        const Reserved item = {i, {0, 0}, i / 2, {0, 0, 0, i}};
        if (i % keep == 0)
            queue.push(item);
        else if (keep == 3 && i % keep == 1)
            queue.push(item);
    }
    slots.close();
}

/// Numbers of items, their order given up, of a queue that 132 * `blocks` blocks have pushed to.
void check_reserved(uint32_t n, uint32_t keep, uint32_t blocks) {
    INFO(n << " threads, 1 of " << keep << ", " << 132 * blocks << " blocks");
    const uint32_t expected = keep == 3 ? (n + 2) / 3 + (n + 1) / 3 : (n + keep - 1) / keep, capacity = with_holes(n);
    DeviceBuffer<Lane> memory(size_t(capacity) * 2);
    memory.zero();
    std::vector<QueueCounter> counters(1);
    counters[0].capacity = capacity;
    DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
    const Queue<Reserved> queue{{memory.data(), capacity}, counter.data()};
    push_reserved<<<132 * blocks, 128>>>({queue}, n, keep);
    cuda_check(cudaDeviceSynchronize(), "push_reserved");
    const QueueCounter c = counter.download()[0];
    REQUIRE(c.count <= capacity);
    REQUIRE(c.items() == expected);
    std::vector<Lane> lanes = memory.download();
    const LaneArray<Reserved> here{lanes.data(), capacity};
    std::vector<uint32_t> seen;
    uint64_t holes = 0, wrong = 0;
    for (uint32_t i = 0; i < c.count; ++i) {
        const Reserved item = here.load(i);
        if (item.path == kNoPath) {
            ++holes;
            continue;
        }
        seen.push_back(item.number);
        wrong += item.path != item.number / 2 || item.again[3] != item.number;
    }
    CHECK(holes == c.holes);
    CHECK(wrong == 0);
    REQUIRE(seen.size() == expected);
    std::sort(seen.begin(), seen.end());
    for (uint32_t i = 0, k = 0; i < n; ++i)
        if (i % keep == 0 || (keep == 3 && i % keep == 1)) wrong += seen[k++] != i;
    CHECK(wrong == 0);
    const bool ahead = std::min(n / 16, kMostHoles) / (132 * blocks * 4) >= 64;
    if (!ahead) CHECK(c.holes == 0);
    if (ahead && expected % 64 != 0) CHECK(c.holes > 0);
}

}  // namespace

TEST_CASE("slots reserved ahead: every push arrives once, what is left over is marked and counted") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    for (const uint32_t n : {1u, 33u, 1000u, (1u << 20) + 1, (1u << 23) + 7, (1u << 25) + 5}) {
        for (const uint32_t keep : {1u, 2u, 3u, 33u}) {
            for (const uint32_t blocks : {1u, 7u}) check_reserved(n, keep, blocks);
        }
    }
}

TEST_CASE("slots reserved ahead: a queue that is too small loses items by count") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    constexpr uint32_t n = 1u << 22, capacity = 1u << 21;
    DeviceBuffer<Lane> memory(size_t(capacity) * 2);
    memory.zero();
    std::vector<QueueCounter> counters(1);
    counters[0].capacity = capacity;
    DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
    push_reserved<<<132, 128>>>({Queue<Reserved>{{memory.data(), capacity}, counter.data()}}, n, 1);
    cuda_check(cudaDeviceSynchronize(), "push_reserved");
    QueueCounter c = counter.download()[0];
    CHECK(c.count >= n);
    CHECK(c.items() <= capacity);
    c.finish();
    CHECK(c.overflow >= n - capacity);
}

namespace {

/// Numbers that depend on nothing but `i`.
uint32_t scrambled(uint32_t i) {
    i = (i ^ i >> 16) * 0x7feb352du;
    i = (i ^ i >> 15) * 0x846ca68bu;
    return i ^ i >> 16;
}

/// Memory of lists over `n` places.
struct OwnedOrder {
    DeviceBuffer<std::byte> memory;
    OrderMemory order;

    OwnedOrder(QueuePolicy policy, uint32_t n) {
        const uint64_t temporary = order_temporary_bytes(policy, n);
        Layout sizes;
        lay_out_order(sizes, policy, n, temporary);
        memory = DeviceBuffer<std::byte>(sizes.bytes());
        Layout layout(sizes, memory.data());
        order = lay_out_order(layout, policy, n, temporary);
    }
    std::vector<uint32_t> read(const uint32_t* list, uint32_t n) const {
        std::vector<uint32_t> values(n);
        cuda_check(cudaMemcpy(values.data(), list, n * sizeof(uint32_t), cudaMemcpyDeviceToHost), "list");
        return values;
    }
};

}  // namespace

TEST_CASE("compaction of flags on a device: the places that hold an item, in order, and their number") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    for (const uint32_t n : {1u, 31u, 32u, 33u, 1000u, (1u << 20) + 1}) {
        const OwnedOrder owned({Compaction::select, Ordering::none}, n);
        for (const uint32_t in_256 : {0u, 1u, 128u, 255u, 256u}) {
            INFO(n << " places, " << in_256 << " of 256 with an item");
            std::vector<uint8_t> flags((n + 255) / 256 * 256);
            std::vector<uint32_t> expected;
            for (uint32_t i = 0; i < n; ++i) {
                flags[i] = scrambled(i) % 256 < in_256;
                if (flags[i]) expected.push_back(i);
            }
            const DeviceBuffer<uint8_t> device_flags{std::span<const uint8_t>(flags)};
            DeviceBuffer<uint32_t> count(2);
            count.zero();
            select_places(owned.order, device_flags.data(), n, count.data(), nullptr);
            detail::count_items<<<7, kStageBlock>>>(device_flags.data(), n, count.data() + 1);
            cuda_check(cudaDeviceSynchronize(), "select_places");
            CHECK(count.download() == std::vector<uint32_t>{uint32_t(expected.size()), uint32_t(expected.size())});
            CHECK(owned.read(owned.order.list[0], uint32_t(expected.size())) == expected);
        }
    }
}

TEST_CASE("sorting places on a device: as a stable sort on the host, for any number of bits") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    for (const uint32_t n : {1u, 31u, 32u, 33u, 1000u, (1u << 20) + 1}) {
        for (const uint32_t bits : {1u, 3u, 8u, 9u, 24u}) {
            INFO(n << " places, " << bits << " bits");
            const OwnedOrder owned({Compaction::atomic, Ordering::material}, n);
            std::vector<uint32_t> keys(n), places(n);
            for (uint32_t i = 0; i < n; ++i) keys[i] = scrambled(i) & ((1u << bits) - 1);
            std::iota(places.begin(), places.end(), 0u);
            list_places(owned.order, nullptr);
            CHECK(owned.read(owned.order.list[0], n) == places);
            cuda_check(cudaMemcpy(owned.order.keys[0], keys.data(), n * sizeof(uint32_t), cudaMemcpyHostToDevice),
                       "keys");
            sort_places(owned.order, nullptr, n, bits, nullptr);
            cuda_check(cudaDeviceSynchronize(), "sort_places");
            std::stable_sort(places.begin(), places.end(), [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
            CHECK(owned.read(owned.order.list[1], n) == places);
            if (bits > 16) continue;
            const std::vector<uint16_t> short_keys(keys.begin(), keys.end());
            const DeviceBuffer<uint16_t> kept{std::span<const uint16_t>(short_keys)};
            cuda_check(cudaMemset(owned.order.list[1], 0xff, n * sizeof(uint32_t)), "places");
            sort_places(owned.order, kept.data(), n, bits, nullptr);
            cuda_check(cudaDeviceSynchronize(), "sort_places");
            CHECK(owned.read(owned.order.list[1], n) == places);
        }
    }
}

namespace {

/// Counts how often it is called for each hit. `Gathers`: as stages of one BSDF are.
template <bool Gathers>
struct Visit {
    static constexpr const char* kName = "visit";

    Queue<PathHit> hits;
    uint32_t* visits;
    bool skips;
    StageRecord* record;

    AMBILUX_HD const Queue<PathHit>& items() const { return hits; }
    bool skips_misses() const { return skips; }
    AMBILUX_HD void operator()(uint32_t i) const {
#if defined(__CUDA_ARCH__)
        atomicAdd(visits + hits.load(i).ray.path, 1u);
#endif
    }
};

}  // namespace

template <bool Gathers>
struct ambilux::LaunchTraits<Visit<Gathers>> : BlocksPerSm<1, Gathers> {};

namespace {

/// Runs Visit over the hits of `n` paths of which some have ended and some have met nothing: one in `misses`, all for
/// 1, none for 0.
template <bool Gathers>
void check_visits(const QueuePolicy& policy, uint32_t n, uint32_t misses, bool skips) {
    INFO(n << " paths, 1 of " << misses << " meets nothing, compaction " << compaction_name(policy.compaction)
           << ", ordering " << ordering_name(policy.ordering) << ", gathers " << Gathers << ", skips " << skips);
    constexpr uint32_t kMaterials = 5;
    const OwnedOrder owned(policy, n);
    std::vector<Lane> lanes(size_t(n) * LaneArray<PathHit>::kLanes + 1);
    std::vector<QueueCounter> counters(1);
    counters[0].capacity = n;
    std::vector<uint8_t> flags((n + 255) / 256 * 256 + 256);
    std::vector<uint16_t> keys(n + 1);
    Queue<PathHit> queue = {{lanes.data(), n}, counters.data(), policy.fixed_places() ? flags.data() : nullptr};
    std::vector<uint32_t> expected(n + 1), met(n + 1);
    for (uint32_t path = 0; path < n; ++path) {
        if (scrambled(path) % 4 == 0) continue;
        const bool miss = misses > 0 && scrambled(path + n) % misses == 0;
        PathHit item{};
        item.ray.path = path;
        item.prim = miss ? kNone : path;
        keys[queue.push(item)] = uint16_t(miss ? kMaterials : scrambled(path) % kMaterials);
        expected[path] = 1;
        met[path] = !miss;
    }
    const uint32_t items = counters[0].count;
    if (policy.fixed_places()) counters[0].count = 0;  // a device counts for itself
    DeviceBuffer<Lane> device_lanes{std::span<const Lane>(lanes)};
    DeviceBuffer<uint8_t> device_flags{std::span<const uint8_t>(flags)};
    DeviceBuffer<uint16_t> device_keys{std::span<const uint16_t>(keys)};
    DeviceBuffer<QueueCounter> device_counters{std::span<const QueueCounter>(counters)};
    DeviceBuffer<WaveState> state(1);
    DeviceBuffer<StageRecord> record(1);
    DeviceBuffer<uint64_t> clock(1);
    DeviceBuffer<uint32_t> visits(n + 1);
    state.zero();
    record.zero();
    clock.zero();
    visits.zero();
    queue = {{device_lanes.data(), n},
             device_counters.data(),
             policy.fixed_places() ? device_flags.data() : nullptr,
             policy.keyed_hits ? device_keys.data() : nullptr};
    SceneView scene{};
    scene.material_count = kMaterials;
    CudaExecutor<false> executor(nullptr, {}, state.data(), clock.data(), scene, owned.order);
    executor.run(Visit<Gathers>{queue, visits.data(), skips, record.data()});
    cuda_check(cudaDeviceSynchronize(), "visits");
    const bool without_misses = Gathers || (skips && policy.keyed_hits && items >= detail::kSortFrom);
    CHECK(visits.download() == (without_misses ? met : expected));
    CHECK(record.download()[0].items == items);
    CHECK(device_counters.download()[0].count == 0);
}

}  // namespace

TEST_CASE("stages of hits on a device: every hit once, and rays that met nothing where they are of use only") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    const QueuePolicy sorted = {Compaction::atomic, Ordering::material, true};
    for (const uint32_t n : {1u, 33u, 1000u, 50000u, (1u << 20) + 1}) {
        for (const uint32_t misses : {0u, 1u, 2u, 9u, 1000u}) {
            for (const Compaction compaction : {Compaction::atomic, Compaction::select, Compaction::none})
                check_visits<true>({compaction, Ordering::none}, n, misses, true);
            for (const bool skips : {false, true}) check_visits<false>(sorted, n, misses, skips);
        }
    }
}

namespace {

__global__ void visit_in_turns(uint32_t n, uint32_t* next, uint32_t* visits, uint32_t* past) {
    detail::in_turns(n, next, [&](uint32_t i) { atomicAdd(i < n ? visits + i : past, 1u); });
}

struct Word {
    uint32_t word[4];
};

struct Mark {
    static constexpr const char* kName = "mark";

    Queue<Word> queue;
    uint32_t* visits;
    StageRecord* record;

    AMBILUX_HD const Queue<Word>& items() const { return queue; }
    AMBILUX_HD void operator()(uint32_t i) const {
#if defined(__CUDA_ARCH__)
        atomicAdd(visits + i, 1u);
#endif
    }
};

}  // namespace

TEST_CASE("turns: every item once, whatever the lengths of runs") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    for (const uint32_t blocks : {1u, 2u, 33u}) {
        const uint32_t threads = blocks * 128;
        for (const uint32_t n :
             {0u, 1u, 31u, 32u, 33u, threads - 1, threads, threads + 1, 16 * threads - 1, 16 * threads,
              16 * threads + 5, 64 * threads - 1, 64 * threads, 64 * threads + 77, 1000 * threads + 255}) {
            INFO(n << " items, " << threads << " threads");
            DeviceBuffer<uint32_t> next(1), past(1), visits(n + 1);
            next.zero(), past.zero(), visits.zero();
            visit_in_turns<<<blocks, 128>>>(n, next.data(), visits.data(), past.data());
            cuda_check(cudaDeviceSynchronize(), "visit_in_turns");
            std::vector<uint32_t> expected(n + 1, 1);
            expected[n] = 0;
            CHECK(visits.download() == expected);
            CHECK(past.download()[0] == (n + 31) / 32 * 32 - n);
        }
    }
}

TEST_CASE("turns: launches go through every item once, one after the other over the same queue or slots") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    int device = 0, multiprocessors = 0;
    cuda_check(cudaGetDevice(&device), "device");
    cuda_check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device), "multiprocessors");
    const uint32_t most_threads = uint32_t(multiprocessors) * 2048;  // resident, so that runs are of all lengths
    for (const uint32_t n : {1000u, 16 * most_threads + 5, 64 * most_threads + 77}) {
        INFO(n << " items");
        DeviceBuffer<Lane> unused(1);
        std::vector<QueueCounter> counters(1);
        counters[0].capacity = counters[0].count = n;
        DeviceBuffer<QueueCounter> counter{std::span<const QueueCounter>(counters)};
        DeviceBuffer<WaveState> state(1);
        DeviceBuffer<StageRecord> record(1);
        DeviceBuffer<uint64_t> clock(1);
        state.zero(), record.zero(), clock.zero();
        const Queue<Word> queue = {{unused.data(), n}, counter.data()};  // of which only the counter is used
        const OwnedOrder owned({}, 0);
        CudaExecutor<false> executor(nullptr, {}, state.data(), clock.data(), SceneView{}, owned.order);
        DeviceBuffer<uint32_t> visits(n);
        const auto check = [&](const char* what, uint32_t times, auto launch) {
            INFO(what);
            visits.zero();
            for (uint32_t k = 0; k < times; ++k) {
                cuda_check(cudaMemcpy(&counter.data()->count, &n, sizeof n, cudaMemcpyHostToDevice), "count");
                launch();
            }
            const std::vector<uint32_t> seen = visits.download();
            uint64_t wrong = 0;
            for (uint32_t i = 0; i < n; ++i) wrong += seen[i] != times;
            CHECK(wrong == 0);
        };
        const Mark mark = {queue, visits.data(), record.data()};
        check("items", 3, [&] { executor.run(mark); });
        CHECK(counter.download()[0].count == 0);
        check("slots", 3, [&] { executor.run_slots(mark, n, 1); });
    }
}

TEST_CASE("bench queues on a device: rows of every operation, and what is drained is what was pushed") {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return;
    }
    const Scene scene = project_scene("cornell");
    for (const uint32_t n : {1u, 33u, 1000u, 50000u, (1u << 20) - 5}) {
        INFO(n << " items");
        const nlohmann::json json = bench_queues(scene, "cuda", n, 1);  // throws if something is lost
        CHECK(json.at("items") == n);
        // Four items appended, listed and counted, one appended only, for four shares; hits are sorted by two kinds of
        // keys.
        const nlohmann::json& rows = json.at("rows");
        REQUIRE(rows.size() == (4 * (2 + 3 + 3) + 2) * 4 + (n < detail::kSortFrom ? 0 : 5 + 4));
        uint64_t wrong = 0;
        for (const nlohmann::json& row : rows) {
            const uint64_t items = row.at("items"), looked = row.at("looked");
            wrong += items > n || looked < items || looked > n;
            if (row.at("item") == "PairItem")
                wrong += items != pushed_contents<PairItem>(n, uint32_t(1 / double(row.at("share")) + 0.5)).items;
            if (items > 0) wrong += !(double(row.at("ns_per_item")) > 0 && double(row.at("gb_per_s")) > 0);
        }
        CHECK(wrong == 0);
    }
    CHECK(bench_queues(Scene{}, "cuda", 50000, 1).at("rows").size() ==
          (4 * (2 + 3 + 3) + 2) * 4 + 5);  // hits of nothing, no rays
}
