#include "backends/bench_rays.h"

#include <tbb/task_arena.h>

#include <algorithm>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "accel/pair_bvh.h"
#include "backends/cuda/bench_rays.h"
#include "backends/cuda_device.h"
#include "backends/fast_cwbvh.h"
#include "backends/ray_batches.h"
#include "backends/traversal_features.h"
#include "core/error.h"

namespace ambilux {
namespace {

constexpr uint32_t kCpuSize = 512, kCudaSize = 2048;

nlohmann::json row(const RayBatch& batch, const KernelTiming& timing) {
    const double count = double(batch.rays.size());
    return {{"batch", batch.name},
            {"count", batch.rays.size()},
            {"hit", count > 0 ? double(timing.hits) / count : 0.0},
            {"kernel", timing.kernel},
            {"tuning", timing.tuning},
            {"mrays_per_s", timing.seconds > 0 ? count / timing.seconds * 1e-6 : 0.0}};
}

template <Features F, class Tracer>
KernelTiming time_on_host(const SceneView& scene, const Tracer& tracer, const RayBatch& batch,
                          const std::string& kernel, int repetitions) {
    constexpr bool kPackets = std::is_same_v<Tracer, EmbreeTracer>;
    const size_t count = batch.rays.size();
    std::vector<Hit> hits(batch.any_hit ? 0 : count);
    std::vector<uint8_t> blocked(batch.any_hit ? count : 0);
    const auto trace = [&] {
        if constexpr (kPackets)
            detail::for_all((count + kMostPacketRays - 1) / kMostPacketRays, [&](size_t p) {
                const size_t k = p * kMostPacketRays;
                const uint32_t n = uint32_t(std::min<size_t>(count - k, kMostPacketRays));
                bool any[kMostPacketRays];
                if (!batch.any_hit)
                    return tracer.template closest<F>(scene, &batch.rays[k], n, batch.coherent, &hits[k]);
                tracer.template occluded<F>(scene, &batch.rays[k], n, false, any);
                std::copy(any, any + n, blocked.begin() + ptrdiff_t(k));
            });
        else if (batch.any_hit)
            detail::for_all(count, [&](size_t k) { blocked[k] = tracer.template occluded<F>(scene, batch.rays[k]); });
        else
            detail::for_all(count, [&](size_t k) { tracer.template closest<F>(scene, batch.rays[k], hits[k]); });
    };
    const std::vector<double> seconds = seconds_of_runs(repetitions, trace);
    uint64_t met = 0;
    for (const Hit& hit : hits) met += hit.prim != kNone;
    for (const uint8_t b : blocked) met += b;
    return {kernel, "-", met, count ? median(seconds) : 0.0};
}

template <Features F, class Tracer>
nlohmann::json rows_on_host(const Scene& scene, const Tracer& tracer, const std::string& kernel, int repetitions) {
    const SceneView view = scene.view();
    nlohmann::json rows = nlohmann::json::array();
    for (const RayBatch& batch : make_ray_batches<F>(view, tracer, kCpuSize, 0))
        rows.push_back(row(batch, time_on_host<F>(view, tracer, batch, kernel, repetitions)));
    return rows;
}

template <class Accel>
nlohmann::json bench_on_host(const Scene& scene, const std::string& accel_name, int repetitions, bool single = false) {
    const Accel accel(scene);
    auto tracer = accel.tracer();
    if constexpr (std::is_same_v<Accel, EmbreeAccel>)
        if (single) tracer.width = 1;
    const nlohmann::json rows = with_traversal_features(
        scene.features, [&](auto set) { return rows_on_host<set.value>(scene, tracer, accel_name, repetitions); });
    return {{"device", "cpu, " + std::to_string(tbb::this_task_arena::max_concurrency()) + " threads"},
            {"accel", accel_name},
            {"repetitions", repetitions},
            {"build_seconds", accel.build_seconds()},
            {"accel_bytes", accel.memory_bytes()},
            {"rows", rows}};
}

/// What a device has built, as if a host had.
class BuiltOnDevice {
public:
    explicit BuiltOnDevice(const Scene& scene) : built_(build_cwbvh_fast_on_device(scene)) {}
    CwbvhTracer tracer() const { return make_tracer(arrays().nodes.data(), arrays().primitives.data()); }
    const CwbvhArrays& arrays() const { return built_.arrays; }
    uint64_t memory_bytes() const { return arrays().bytes(); }
    double build_seconds() const { return built_.seconds; }

private:
    FastOnDevice built_;
};

void need_device() {
    if (!cuda_device_present()) throw Error(ExitCode::device, "--backend cuda: " + why_no_cuda_device());
}

template <class Accel>
std::vector<RayBatch> device_batches(const Scene& scene, const Accel& accel) {
    return with_traversal_features(scene.features, [&](auto set) {
        return make_ray_batches<set.value>(scene.view(), accel.tracer(), kCudaSize, 0);
    });
}

nlohmann::json on_device(const std::vector<RayBatch>& batches, const std::vector<std::vector<KernelTiming>>& timings,
                         const std::string& accel_name, int repetitions, double build_seconds, uint64_t bytes) {
    nlohmann::json rows = nlohmann::json::array();
    for (size_t i = 0; i < batches.size(); ++i)
        for (const KernelTiming& timing : timings[i]) rows.push_back(row(batches[i], timing));
    return {{"device", cuda_device_name()},   {"accel", accel_name},  {"repetitions", repetitions},
            {"build_seconds", build_seconds}, {"accel_bytes", bytes}, {"rows", rows}};
}

nlohmann::json bench_optix(const Scene& scene, int repetitions) {
    need_device();
    const std::vector<RayBatch> batches = device_batches(scene, CwbvhAccel(scene));
    const OptixTimings timings = time_rays_by_optix(scene, batches, kBenchWarmUps, repetitions);
    return on_device(batches, timings.batches, "optix", repetitions, timings.facts.build_seconds, timings.facts.bytes);
}

template <class Accel>
nlohmann::json bench_on_device(const Scene& scene, const std::string& accel_name, int repetitions) {
    need_device();
    const Accel accel(scene);
    const std::vector<RayBatch> batches = device_batches(scene, accel);
    return on_device(batches, time_rays_on_device(scene, accel.arrays(), batches, kBenchWarmUps, repetitions),
                     accel_name, repetitions, accel.build_seconds(), accel.memory_bytes());
}

}  // namespace

double median(std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    const size_t half = seconds.size() / 2;
    return seconds.size() % 2 ? seconds[half] : 0.5 * (seconds[half - 1] + seconds[half]);
}

nlohmann::json bench_rays(const Scene& scene, const std::string& backend, int repetitions, bool opaque) {
    if (repetitions < 1)
        throw Error(ExitCode::usage, "bench rays: at least 1 repetition is needed, not " + std::to_string(repetitions));
    if (opaque && scene.features.opacity) {
        Scene solid = scene;
        for (Material& material : solid.materials) material.opacity = {1.0f, -1};
        solid.features.opacity = false;
        return bench_rays(solid, backend, repetitions, opaque);
    }
    const std::string chosen = backend != "auto" ? backend : cuda_device_present() ? "cuda" : "cpu";
    nlohmann::json json;
    if (chosen == "cpu")
        json = bench_on_host<EmbreeAccel>(scene, "embree", repetitions);
    else if (chosen == "cpu-single")
        json = bench_on_host<EmbreeAccel>(scene, "embree", repetitions, true);
    else if (chosen == "cpu-cwbvh")
        json = bench_on_host<CwbvhAccel>(scene, "cwbvh", repetitions);
    else if (chosen == "cpu-fast")
        json = bench_on_host<FastCwbvhAccel>(scene, "cwbvh", repetitions);
    else if (chosen == "cuda-fast")
        json = bench_on_device<BuiltOnDevice>(scene, "cwbvh", repetitions);
    else if (chosen == "cuda")
        json = bench_on_device<CwbvhAccel>(scene, "cwbvh", repetitions);
    else if (chosen == "cpu-bvh2")
        json = bench_on_host<PairAccel>(scene, "bvh2", repetitions);
    else if (chosen == "cuda-bvh2")
        json = bench_on_device<PairAccel>(scene, "bvh2", repetitions);
    else if (chosen == "cuda-optix")
        json = bench_optix(scene, repetitions);
    else
        throw Error(ExitCode::usage, "bench rays: backend '" + backend +
                                         "' is not one of auto, cpu, cpu-single, cpu-cwbvh, cpu-fast, cpu-bvh2, cuda, "
                                         "cuda-fast, cuda-bvh2, cuda-optix");
    json["backend"] = chosen;
    json["opaque"] = opaque;
    return json;
}

}  // namespace ambilux
