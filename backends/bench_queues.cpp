#include "backends/bench_queues.h"

#include <tbb/task_arena.h>

#include <algorithm>

#include "accel/embree_tracer.h"
#include "backends/bench_rays.h"
#include "backends/cpu/executor.h"
#include "backends/cpu/host_memory.h"
#include "backends/cuda/bench_queues.h"
#include "backends/cuda_device.h"
#include "backends/ray_batches.h"
#include "core/error.h"

namespace ambilux {
namespace {

constexpr uint32_t kCpuItems = 512 * 512, kCudaItems = 2048 * 2048, kMostItems = 1u << 28;
constexpr uint32_t kMostSide = 2048;    ///< of the film that the scene's items come from
constexpr uint32_t kCpuWaveSize = 512;  ///< as renders have

/// What a scene's paths have in their queues after the camera rays: their hits, and the rays that leave these.
struct SceneItems {
    std::vector<PathHit> hits;
    std::vector<PathRay> rays;
};

PathRay ray_item(const Ray& ray, uint32_t path, uint32_t depth) {
    return {ray.o, path, ray.d, SubpathBits::make(depth, false, 1.0f), splat(1.0f), 1.0f, {}};
}

/// Of a film of the least power of two pixels a side that has `items` pixels, but for kMostSide, the first `items`.
SceneItems make_scene_items(const Scene& scene, uint32_t items) {
    uint32_t side = 1;
    while (side < kMostSide && side * side < items) side *= 2;
    const EmbreeAccel accel(scene);
    const SceneView view = scene.view();
    const std::vector<RayBatch> batches = make_ray_batches<kAllFeatures>(view, accel.tracer(), side, 0);
    const std::vector<Ray>&camera = batches[0].rays, &bounced = batches[1].rays;
    SceneItems s;
    s.hits.resize(std::min<size_t>(camera.size(), items));
    s.rays.resize(std::min<size_t>(bounced.size(), items));
    detail::for_all(s.hits.size(), [&](size_t i) {
        Hit hit;
        accel.tracer().closest<kAllFeatures>(view, camera[i], hit);
        s.hits[i] = {ray_item(camera[i], uint32_t(i), 1), hit.u, hit.v, hit.prim, 0};
    });
    detail::for_all(s.rays.size(), [&](size_t i) { s.rays[i] = ray_item(bounced[i], uint32_t(i), 2); });
    return s;
}

/// The queue of one thread.
template <class Item>
struct HostQueue {
    HostMemory memory;
    Queue<Item> queue;
    OrderMemory order;
    WaveState state = {};
    StageRecord push = {}, drain = {};
    QueueContents contents = {};

    explicit HostQueue(const QueuePolicy& policy) {
        Layout sizes;
        lay_out(sizes, policy);
        memory = HostMemory(sizes.bytes());
        Layout layout(sizes, memory.data());
        lay_out(layout, policy);
        *queue.counter = layout.first_counters()[0];
    }
    void lay_out(Layout& layout, const QueuePolicy& policy) {
        queue = layout.queue<Item>("items", kCpuWaveSize, policy.fixed_places());
        order = lay_out_order(layout, policy, kCpuWaveSize);
    }
};

/// Seconds of the two halves of one run, medians.
struct HostSeconds {
    double push, drain;
};

/// Empties a queue that push(executor, queue, wave) has filled, `waves` times on all threads, which is a run, and
/// checks that all runs drain what is `pushed`. By material if items have one, rays by Morton code.
template <class Item, class Push>
HostSeconds time_on_host(const char* name, const SceneView& scene, const QueuePolicy& policy, uint32_t waves,
                         const QueueContents& pushed, int repetitions, Push push) {
    const uint32_t threads = uint32_t(tbb::this_task_arena::max_concurrency());
    std::vector<HostQueue<Item>> queues;
    for (uint32_t t = 0; t < threads; ++t) queues.emplace_back(policy);
    const auto run = [&]() -> HostSeconds {
        parallel_for(threads, [&](uint32_t t) {
            HostQueue<Item>& q = queues[t];
            q.push = q.drain = {};
            q.contents = {};
            CpuExecutor executor(&q.state, scene, q.order);
            const DrainItems<Item> drain = {q.queue, &q.contents, true, &q.drain};
            for (uint32_t wave = t; wave < waves; wave += threads) {
                push(executor, q, wave);
                if constexpr (std::is_same_v<Item, PathRay>)
                    executor.trace(drain);
                else
                    executor.run(drain);
            }
        });
        QueueContents found = {};
        uint64_t pushing = 0, draining = 0;
        for (const HostQueue<Item>& q : queues) {
            found.items += q.contents.items + q.queue.counter->overflow;
            found.sum += q.contents.sum;
            pushing += q.push.nanoseconds;
            draining += q.drain.nanoseconds;
        }
        check_contents(name, found, pushed);
        return {double(pushing) * 1e-9 / threads, double(draining) * 1e-9 / threads};
    };
    std::vector<double> push_seconds, drain_seconds;
    for (const HostSeconds& s : runs_that_count(repetitions, run)) {
        push_seconds.push_back(s.push);
        drain_seconds.push_back(s.drain);
    }
    return {median(std::move(push_seconds)), median(std::move(drain_seconds))};
}

/// The drain of `items` as they are and in order.
template <class Item>
void time_order_on_host(const char* name, const SceneView& scene, Ordering ordering, const std::vector<Item>& items,
                        int repetitions, std::vector<QueueTiming>& rows) {
    const uint32_t n = uint32_t(items.size()), waves = (n + kCpuWaveSize - 1) / kCpuWaveSize;
    QueueContents pushed = {n, 0};
    for (const Item& item : items) pushed.sum += item_sum(item);
    for (const QueuePolicy policy : {QueuePolicy{}, QueuePolicy{Compaction::atomic, ordering}}) {
        const HostSeconds seconds = time_on_host<Item>(
            name, scene, policy, waves, pushed, repetitions, [&](CpuExecutor&, HostQueue<Item>& q, uint32_t wave) {
                for (uint32_t i = wave * kCpuWaveSize; i < std::min(n, (wave + 1) * kCpuWaveSize); ++i)
                    q.queue.push(items[i]);
            });
        rows.push_back({"drain", name, sizeof(Item), policy, 1, n, n, seconds.drain});
    }
}

/// `items`: a multiple of kCpuWaveSize.
std::vector<QueueTiming> time_queues_on_host(const Scene& scene, uint32_t items, const SceneItems& scene_items,
                                             int repetitions) {
    const SceneView view = scene.view();
    const uint32_t waves = items / kCpuWaveSize;
    std::vector<QueueTiming> rows;
    for_pushed_items([&]<class Item>(const char* name, std::type_identity<Item>) {
        for (const uint32_t one_in : kPushShares) {
            const QueueContents of_wave = pushed_contents<Item>(kCpuWaveSize, one_in),
                                pushed = {of_wave.items * waves, of_wave.sum * waves};
            for (const Compaction compaction : kCompactions) {
                if (!is_compacted<Item>(compaction)) continue;
                const QueuePolicy policy = {compaction};
                const HostSeconds seconds = time_on_host<Item>(
                    name, view, policy, waves, pushed, repetitions,
                    [&](CpuExecutor& executor, HostQueue<Item>& q, uint32_t) {
                        executor.run_slots(PushMade<Item>{q.queue, one_in, &q.push}, kCpuWaveSize, 1);
                    });
                rows.push_back({"push", name, sizeof(Item), policy, one_in, items, pushed.items, seconds.push});
                rows.push_back({"drain", name, sizeof(Item), policy, one_in,
                                policy.fixed_places() ? items : pushed.items, pushed.items, seconds.drain});
            }
        }
    });
    time_order_on_host("PathHit", view, Ordering::material, scene_items.hits, repetitions, rows);
    time_order_on_host("PathRay", view, Ordering::morton, scene_items.rays, repetitions, rows);
    return rows;
}

/// Bytes that one run has to read or write: items; flags and list; keys; keys and places, which are read and written.
double bytes_moved(const QueueTiming& t) {
    const double items = double(t.items);
    if (t.operation == "compact")
        return double(t.looked) + (t.policy.compaction == Compaction::select ? sizeof(uint32_t) * items : 0.0);
    if (t.operation == "sort") return 2.0 * (t.bytes + sizeof(uint32_t)) * items;
    return t.bytes * items;
}

nlohmann::json row(const QueueTiming& t) {
    const auto ns_per = [&](uint64_t n) { return n > 0 ? t.seconds * 1e9 / double(n) : 0.0; };
    return {{"operation", t.operation},
            {"item", t.item},
            {"bytes", t.bytes},
            {"compaction", compaction_name(t.policy.compaction)},
            {"order", ordering_name(t.policy.ordering)},
            {"share", 1.0 / t.one_in},
            {"looked", t.looked},
            {"items", t.items},
            {"ns_per_look", ns_per(t.looked)},
            {"ns_per_item", ns_per(t.items)},
            {"gb_per_s", t.seconds > 0 ? bytes_moved(t) / t.seconds * 1e-9 : 0.0}};
}

}  // namespace

nlohmann::json bench_queues(const Scene& scene, const std::string& backend, uint32_t items, int repetitions) {
    if (repetitions < 1)
        throw Error(ExitCode::usage,
                    "bench queues: at least 1 repetition is needed, not " + std::to_string(repetitions));
    if (items > kMostItems)
        throw Error(ExitCode::usage,
                    "bench queues: at most " + std::to_string(kMostItems) + " items, not " + std::to_string(items));
    if (backend != "auto" && backend != "cpu" && backend != "cuda")
        throw Error(ExitCode::usage, "bench queues: backend '" + backend + "' is not one of auto, cpu, cuda");
    const bool cuda = backend == "cuda" || (backend == "auto" && cuda_device_present());
    if (cuda && !cuda_device_present()) throw Error(ExitCode::device, "--backend cuda: " + why_no_cuda_device());
    if (items == 0) items = cuda ? kCudaItems : kCpuItems;
    if (!cuda) items = (items + kCpuWaveSize - 1) / kCpuWaveSize * kCpuWaveSize;
    const SceneItems from_scene = make_scene_items(scene, items);
    const std::vector<QueueTiming> timings =
        cuda ? time_queues_on_device(scene, items, from_scene.hits, from_scene.rays, kBenchWarmUps, repetitions)
             : time_queues_on_host(scene, items, from_scene, repetitions);
    nlohmann::json rows = nlohmann::json::array();
    for (const QueueTiming& timing : timings) rows.push_back(row(timing));
    return {{"backend", cuda ? "cuda" : "cpu"},
            {"device", cuda ? cuda_device_name()
                            : "cpu, " + std::to_string(tbb::this_task_arena::max_concurrency()) + " threads"},
            {"items", items},
            {"repetitions", repetitions},
            {"rows", rows}};
}

}  // namespace ambilux
