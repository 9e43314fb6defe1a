#include "backends/cuda/bench_rays.h"

#include <algorithm>

#include "backends/cuda/device_memory.h"
#include "backends/cuda/device_scene.h"
#include "backends/cuda/median_seconds.cuh"
#include "backends/cuda/trace_kernels.cuh"

namespace ambilux {
namespace {

template <class Set, class Tracer>
std::vector<KernelTiming> time_batch(const SceneView& scene, const Tracer& tracer, const RayBatch& batch, int warm_ups,
                                     int repetitions) {
    struct Variant {
        const char *kernel, *tuning;
        TraceTuning values;
    };
    std::vector<Variant> variants = {{"persistent", "incoherent", kIncoherentTuning},
                                     {"persistent", "coherent", kCoherentTuning},
                                     {"plain", "-", {}}};
    if (batch.coherent) std::swap(variants[0], variants[2]);

    const uint32_t count = uint32_t(batch.rays.size()), blocks = (count + kTraceBlock - 1) / kTraceBlock;
    std::vector<KernelTiming> timings;
    if (count == 0) {
        for (const Variant& v : variants) timings.push_back({v.kernel, v.tuning, 0, 0.0});
        return timings;
    }
    const DeviceBuffer<Ray> rays(batch.rays, "rays");
    const DeviceBuffer<uint32_t> ray_count(std::span<const uint32_t>(&count, 1), "counter");
    DeviceBuffer<Hit> hits(batch.any_hit ? 0 : count, "hits");
    DeviceBuffer<uint8_t> blocked(batch.any_hit ? count : 0, "hits");
    DeviceBuffer<uint32_t> next_rays(size_t(warm_ups + repetitions),
                                     "counters");  // one per launch: nothing to clear in between
    const uint32_t grid = batch.any_hit ? persistent_grid(trace_any_kernel<Set, Tracer>)
                                        : persistent_grid(trace_closest_kernel<Set, Tracer>);
    for (const Variant& v : variants) {
        const bool plain = std::string(v.kernel) == "plain";
        next_rays.zero();
        hits.zero();
        blocked.zero();
        const auto launch = [&](size_t i) {
            if (plain && batch.any_hit)
                trace_any_plain_kernel<Set, Tracer>
                    <<<blocks, kTraceBlock>>>(scene, tracer, rays.data(), blocked.data(), count);
            else if (plain)
                trace_closest_plain_kernel<Set, Tracer>
                    <<<blocks, kTraceBlock>>>(scene, tracer, rays.data(), hits.data(), count);
            else if (batch.any_hit)
                trace_any_kernel<Set, Tracer><<<grid, kTraceBlock>>>(scene, tracer, rays.data(), blocked.data(),
                                                                     ray_count.data(), next_rays.data() + i, v.values);
            else
                trace_closest_kernel<Set, Tracer><<<grid, kTraceBlock>>>(
                    scene, tracer, rays.data(), hits.data(), ray_count.data(), next_rays.data() + i, v.values);
        };
        const double seconds = median_seconds("ray traversal", warm_ups, repetitions, {launch})[0];
        uint64_t met = 0;
        for (const Hit& hit : hits.download()) met += hit.prim != kNone;
        for (const uint8_t b : blocked.download()) met += b;
        timings.push_back({v.kernel, v.tuning, met, seconds});
    }
    return timings;
}

template <class Tracer>
std::vector<std::vector<KernelTiming>> time_batches(const Scene& scene, const Tracer& tracer,
                                                    const std::vector<RayBatch>& batches, int warm_ups,
                                                    int repetitions) {
    const DeviceScene device_scene(scene);
    std::vector<std::vector<KernelTiming>> timings;
    for (const RayBatch& batch : batches)
        timings.push_back(with_traversal_features(scene.features, [&](auto set) {
            return time_batch<decltype(set), Tracer>(device_scene.view(), tracer, batch, warm_ups, repetitions);
        }));
    return timings;
}

}  // namespace

std::vector<std::vector<KernelTiming>> time_rays_on_device(const Scene& scene, const CwbvhArrays& cwbvh,
                                                           const std::vector<RayBatch>& batches, int warm_ups,
                                                           int repetitions) {
    const DeviceCwbvh device_cwbvh(cwbvh);
    return time_batches(scene, device_cwbvh.tracer(), batches, warm_ups, repetitions);
}

std::vector<std::vector<KernelTiming>> time_rays_on_device(const Scene& scene, const PairArrays& pairs,
                                                           const std::vector<RayBatch>& batches, int warm_ups,
                                                           int repetitions) {
    const DevicePairs device_pairs(pairs);
    return time_batches(scene, device_pairs.tracer(), batches, warm_ups, repetitions);
}

}  // namespace ambilux
