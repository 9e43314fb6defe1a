#include "backends/cuda/bench_queues.h"

#include "backends/cuda/device_scene.h"
#include "backends/cuda/median_seconds.cuh"
#include "backends/cuda/order.h"
#include "backends/cuda/record_kernels.cuh"
#include "backends/cuda/stage_kernels.cuh"

namespace ambilux {
namespace {

/// Runs that do not count and runs that do.
struct Runs {
    int warm_ups, repetitions;

    /// The first run and one after the last, in which drained items are counted; neither is timed.
    size_t last() const { return size_t(warm_ups + repetitions); }
    bool counted(size_t i) const { return i == 0 || i == last(); }
    static constexpr uint64_t kCounted = 2;
};

/// A queue with all that kernels ask for beside it.
template <class Item>
struct DeviceQueue {
    DeviceBuffer<std::byte> bytes;
    Queue<Item> queue;
    QueueCounter* counters;  ///< the queue's, and one that is always full, of the threads that push
    uint16_t* kept_keys;
    OrderMemory order;
    WaveState* state;
    StageRecord* record;
    uint64_t* clock;
    QueueContents* contents;  ///< DrainItems
    uint32_t drain_grid = persistent_grid(detail::launch_items<DrainItems<Item>>, kStageBlock);

    /// `n`: places. `in_queue`: items that it is to hold at first.
    DeviceQueue(uint32_t n, const QueuePolicy& policy, uint32_t in_queue) {
        const uint64_t temporary = order_temporary_bytes(policy, n);
        Layout sizes;
        lay_out(sizes, n, policy, temporary);
        bytes = DeviceBuffer<std::byte>(sizes.bytes(), "queue");
        bytes.zero();
        Layout layout(sizes, bytes.data());
        lay_out(layout, n, policy, temporary);
        QueueCounter first[2] = {};
        first[0].capacity = first[1].capacity = first[1].count = n;
        first[0].count = in_queue;
        cuda_check(cudaMemcpy(counters, first, sizeof first, cudaMemcpyHostToDevice), "counters");
        if (policy.ordering != Ordering::none) list_places(order, nullptr);
    }
    void lay_out(Layout& layout, uint32_t n, const QueuePolicy& policy, uint64_t temporary) {
        queue = layout.queue<Item>("items", n, policy.fixed_places());
        counters = queue.counter;
        layout.queue<PairItem>("full", 0);
        kept_keys = layout.allocate<uint16_t>(policy.keyed_hits ? n : 0);
        order = lay_out_order(layout, policy, n, temporary);
        state = layout.allocate<WaveState>(1);
        record = layout.record("queue");
        clock = layout.allocate<uint64_t>(1);
        contents = layout.allocate<QueueContents>(2);
    }

    /// Before a launch over either counter, which starts at their first items.
    void start_over() const {
        for (const int k : {0, 1})
            cuda_check(cudaMemsetAsync(&counters[k].next, 0, sizeof(uint32_t), nullptr), "counters");
    }
    /// `list`: places of items, or null.
    void drain(const uint32_t* list, bool counted) const {
        const DrainItems<Item> stage = {queue, contents, counted};
        detail::launch_items<<<drain_grid, kStageBlock>>>(
            stage, detail::Items{counters, list, queue.flags, queue.capacity(), nullptr, nullptr, 0});
    }
    template <class T>
    T read(const T* place) const {
        T value;
        cuda_check(cudaMemcpy(&value, place, sizeof value, cudaMemcpyDeviceToHost), "copy from the device");
        return value;
    }
};

template <class Item>
void time_pushes(const char* name, uint32_t n, uint32_t one_in, const QueueContents& pushed, Compaction compaction,
                 const Runs& runs, std::vector<QueueTiming>& rows) {
    const QueuePolicy policy = {compaction};
    const DeviceQueue<Item> q(n, policy, 0);
    const PushMade<Item> stage = {q.queue, one_in};
    const uint32_t push_grid = persistent_grid(detail::launch_items<PushMade<Item>>, kStageBlock),
                   count_grid = persistent_grid(detail::count_items, kStageBlock);
    // As a stage does that looks at n items and pushes for some.
    const auto push = [&](size_t) {
        detail::launch_items<<<push_grid, kStageBlock>>>(
            stage, detail::Items{q.counters + 1, nullptr, nullptr, n, nullptr, nullptr, 0});
    };
    const auto compact = [&](size_t) {
        if (compaction == Compaction::select)
            select_places(q.order, q.queue.flags, n, &q.counters->count, nullptr);
        else if (compaction == Compaction::none)
            detail::count_items<<<count_grid, kStageBlock>>>(q.queue.flags, n, &q.counters->count);
    };
    const auto drain = [&](size_t i) {
        q.drain(compaction == Compaction::select ? q.order.list[0] : nullptr, runs.counted(i));
    };
    const auto finish = [&](size_t) {
        detail::finish_stage<<<1, 1>>>(q.record, q.counters, nullptr, nullptr, 0, 0, detail::DepthChange{}, q.state,
                                       q.clock);
        q.start_over();
    };
    const std::vector<double> seconds =
        median_seconds("queues", runs.warm_ups, runs.repetitions, {push, compact, drain, finish});
    const size_t last = runs.last();
    push(last), compact(last), drain(last), finish(last);
    compact(last);  // finds what is not empty now
    cuda_check(cudaDeviceSynchronize(), "queues");

    const QueueCounter counter = q.read(q.counters);
    check_contents(name, {q.read(q.record).items + counter.count + counter.overflow, 0},
                   {pushed.items * (last + 1), 0});
    check_contents(name, q.read(q.contents), {pushed.items * Runs::kCounted, pushed.sum * Runs::kCounted});
    rows.push_back({"push", name, sizeof(Item), policy, one_in, n, pushed.items, seconds[0]});
    if (policy.fixed_places())
        rows.push_back({"compact", name, sizeof(Item), policy, one_in, n, pushed.items, seconds[1]});
    rows.push_back({"drain", name, sizeof(Item), policy, one_in, compaction == Compaction::none ? n : pushed.items,
                    pushed.items, seconds[2]});
}

/// Throws Error(device) if the places of `n` items, as sorted last, are not those of all in the order of their keys,
/// equal ones as they were.
template <class Key>
void check_sorted(const char* name, const OrderMemory& order, const Key* keys, uint32_t n) {
    std::vector<Key> key(n);
    std::vector<uint32_t> list(n);
    cuda_check(cudaMemcpy(key.data(), keys, n * sizeof(Key), cudaMemcpyDeviceToHost), "keys");
    cuda_check(cudaMemcpy(list.data(), order.list[1], n * sizeof(uint32_t), cudaMemcpyDeviceToHost), "places");
    for (uint32_t i = 0; i < n; ++i) {
        const bool follows = list[i] < n && (i == 0 || key[list[i - 1]] < key[list[i]] ||
                                             (key[list[i - 1]] == key[list[i]] && list[i - 1] < list[i]));
        if (!follows) throw Error(ExitCode::device, "bench queues: places of " + std::string(name) + " are not sorted");
    }
}

/// `device`: `scene` on the device.
template <class Order, class Item>
void time_order(const char* name, const SceneView& scene, const SceneView& device, const std::vector<Item>& items,
                const Runs& runs, std::vector<QueueTiming>& rows) {
    constexpr bool kept = std::is_same_v<Order, MaterialOrder>;  // there are hits that lie with their keys
    const uint32_t n = uint32_t(items.size()), bits = Order::bits(scene);
    if (n < detail::kSortFrom) return;
    const QueuePolicy policy = {Compaction::atomic, Order::kOrdering, kept};
    const DeviceQueue<Item> q(n, policy, n);
    std::vector<Lane> lanes(size_t(n) * LaneArray<Item>::kLanes);
    std::vector<uint16_t> keys(kept ? n : 0);
    QueueCounter counter = {};
    const Queue<Item> here = {{lanes.data(), n}, &counter};
    QueueContents pushed = {n, 0};
    for (uint32_t i = 0; i < n; ++i) {
        here.push(items[i]);
        pushed.sum += item_sum(items[i]);
        if constexpr (kept) keys[i] = uint16_t(Order::key(scene, items[i]));
    }
    cuda_check(cudaMemcpy(q.queue.items.base, lanes.data(), lanes.size() * sizeof(Lane), cudaMemcpyHostToDevice),
               "items");
    if (kept)
        cuda_check(cudaMemcpy(q.kept_keys, keys.data(), keys.size() * sizeof(uint16_t), cudaMemcpyHostToDevice),
                   "keys");

    const uint32_t grid = persistent_grid(detail::make_keys<Order, Item>, kStageBlock);
    const detail::Items all = {q.counters, nullptr, nullptr, n, nullptr, nullptr, 0};
    const auto look_up = [&](size_t) {
        detail::make_keys<Order, Item>
            <<<grid, kStageBlock>>>(device, q.queue, all, (1u << bits) - 1, q.order.keys[0], detail::SortSwitch{});
    };
    const auto sort_kept = [&](size_t) {
        if (kept) sort_places(q.order, q.kept_keys, n, bits, nullptr);
    };
    const auto sort = [&](size_t) { sort_places(q.order, nullptr, n, bits, nullptr); };
    const auto drain = [&](size_t i) { q.drain(nullptr, runs.counted(i)); };
    const auto drain_sorted = [&](size_t i) { q.drain(q.order.list[1], runs.counted(i)); };
    const auto start_over = [&](size_t) { q.start_over(); };
    const std::vector<double> seconds =
        median_seconds("ordering", runs.warm_ups, runs.repetitions,
                       {look_up, sort_kept, sort, drain, start_over, drain_sorted, start_over});
    const size_t last = runs.last();
    sort_kept(last);
    if (kept) check_sorted(name, q.order, q.kept_keys, n);
    look_up(last), sort(last);
    check_sorted(name, q.order, q.order.keys[0], n);
    drain(last), start_over(last), drain_sorted(last);
    check_contents(name, q.read(q.contents), {pushed.items * 2 * Runs::kCounted, pushed.sum * 2 * Runs::kCounted});

    rows.push_back({"keys", name, sizeof(uint32_t), policy, 1, n, n, seconds[0]});
    rows.push_back({"sort", name, sizeof(uint32_t), policy, 1, n, n, seconds[2]});
    if (kept) rows.push_back({"sort", name, sizeof(uint16_t), policy, 1, n, n, seconds[1]});
    rows.push_back({"drain", name, sizeof(Item), {}, 1, n, n, seconds[3]});
    rows.push_back({"drain", name, sizeof(Item), policy, 1, n, n, seconds[5]});
}

}  // namespace

std::vector<QueueTiming> time_queues_on_device(const Scene& scene, uint32_t items, const std::vector<PathHit>& hits,
                                               const std::vector<PathRay>& rays, int warm_ups, int repetitions) {
    const Runs runs = {warm_ups, repetitions};
    std::vector<QueueTiming> rows;
    for_pushed_items([&]<class Item>(const char* name, std::type_identity<Item>) {
        for (const uint32_t one_in : kPushShares) {
            const QueueContents pushed = pushed_contents<Item>(items, one_in);
            for (const Compaction compaction : kCompactions)
                if (is_compacted<Item>(compaction))
                    time_pushes<Item>(name, items, one_in, pushed, compaction, runs, rows);
        }
    });
    const DeviceScene device(scene);
    time_order<MaterialOrder>("PathHit", scene.view(), device.view(), hits, runs, rows);
    time_order<MortonOrder>("PathRay", scene.view(), device.view(), rays, runs, rows);
    return rows;
}

}  // namespace ambilux
