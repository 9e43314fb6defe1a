#include "backends/trace_on_device.h"

#include "backends/cuda/device_memory.h"
#include "backends/cuda/device_scene.h"
#include "backends/cuda/trace_kernels.cuh"

namespace ambilux {
namespace {

template <class Set, class Tracer>
std::vector<Hit> trace(const DeviceScene& scene, const Tracer& tracer, const DeviceBuffer<Ray>& rays, bool any_hit,
                       bool persistent) {
    const uint32_t count = uint32_t(rays.size());
    if (count == 0 && !persistent) return {};  // a grid of no blocks is an error
    const uint32_t blocks = (count + kTraceBlock - 1) / kTraceBlock;
    DeviceBuffer<Hit> hits(any_hit ? 0 : count, "hits");
    DeviceBuffer<uint8_t> blocked(any_hit ? count : 0, "hits");
    // No ray may be left out: what a kernel does not write must not look like an answer.
    if (count && any_hit) cuda_check(cudaMemset(blocked.data(), 0xff, blocked.bytes()), "clear hits");
    if (count && !any_hit) cuda_check(cudaMemset(hits.data(), 0xff, hits.bytes()), "clear hits");
    const uint32_t counters_before[2] = {count, 0};
    DeviceBuffer<uint32_t> counters(std::span<const uint32_t>(counters_before, 2), "counters");
    uint32_t* const ray_count = counters.data();
    uint32_t* const next_ray = counters.data() + 1;
    if (persistent && any_hit)
        trace_any_kernel<Set, Tracer><<<persistent_grid(trace_any_kernel<Set, Tracer>), kTraceBlock>>>(
            scene.view(), tracer, rays.data(), blocked.data(), ray_count, next_ray, kIncoherentTuning);
    else if (persistent)
        trace_closest_kernel<Set, Tracer><<<persistent_grid(trace_closest_kernel<Set, Tracer>), kTraceBlock>>>(
            scene.view(), tracer, rays.data(), hits.data(), ray_count, next_ray, kIncoherentTuning);
    else if (any_hit)
        trace_any_plain_kernel<Set, Tracer>
            <<<blocks, kTraceBlock>>>(scene.view(), tracer, rays.data(), blocked.data(), count);
    else
        trace_closest_plain_kernel<Set, Tracer>
            <<<blocks, kTraceBlock>>>(scene.view(), tracer, rays.data(), hits.data(), count);
    cuda_check(cudaGetLastError(), "launch of ray traversal");
    cuda_check(cudaDeviceSynchronize(), "ray traversal");
    if (!any_hit) return hits.download();
    std::vector<Hit> answers(count);
    const std::vector<uint8_t> flags = blocked.download();
    for (uint32_t i = 0; i < count; ++i) {
        if (flags[i] > 1) throw Error(ExitCode::device, "ray traversal left out ray " + std::to_string(i));
        answers[i] = {0.0f, 0.0f, 0.0f, flags[i] ? 0u : kNone};
    }
    return answers;
}

}  // namespace

std::vector<Hit> trace_on_device(const Scene& scene, const std::vector<Ray>& rays, bool any_hit, bool persistent,
                                 bool binary) {
    const DeviceScene device_scene(scene);
    const DeviceBuffer<Ray> device_rays(rays, "rays");
    const auto with = [&](const auto& tracer) {
        using Tracer = std::remove_cvref_t<decltype(tracer)>;
        return with_traversal_features(scene.features, [&](auto set) {
            return trace<decltype(set), Tracer>(device_scene, tracer, device_rays, any_hit, persistent);
        });
    };
    if (binary) {
        const DevicePairs pairs(PairAccel(scene).arrays());
        return with(pairs.tracer());
    }
    const DeviceCwbvh cwbvh(CwbvhAccel(scene).arrays());
    return with(cwbvh.tracer());
}

}  // namespace ambilux
