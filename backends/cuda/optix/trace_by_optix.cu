#include "backends/cuda/bench_rays.h"
#include "backends/cuda/device_optix.h"
#include "backends/cuda/device_scene.h"
#include "backends/cuda/median_seconds.cuh"
#include "backends/trace_on_device.h"

namespace ambilux {
namespace {

/// Arrays of rays that are handed over as they are.
class RayArrays {
public:
    RayArrays(const Scene& scene) : scene_(scene), optix_(scene, scene_.view(), free_device_bytes()) {}

    void take(const std::vector<Ray>& rays) {
        rays_ = DeviceBuffer<Ray>(rays, "rays");
        hits_ = DeviceBuffer<Hit>(rays.size(), "hits");
        hits_.zero();
        const uint32_t count = uint32_t(rays.size());
        optix_.take({rays_.data(), hits_.data(), count_.data(), count}, nullptr);
        count_.upload(std::span<const uint32_t>(&count, 1));
    }
    std::vector<Hit> hits() const { return hits_.download(); }
    const DeviceOptix& optix() const { return optix_; }

private:
    DeviceScene scene_;
    DeviceOptix optix_;
    DeviceBuffer<Ray> rays_;
    DeviceBuffer<Hit> hits_;
    DeviceBuffer<uint32_t> count_{1, "counter"};
};

}  // namespace

OptixAnswers trace_by_optix(const Scene& scene, const std::vector<Ray>& rays, bool any_hit) {
    wait_for_default_stream("rays");
    const uint64_t before = free_device_bytes();
    RayArrays arrays(scene);
    const DeviceOptix& optix = arrays.optix();
    OptixAnswers answers;
    if (!rays.empty()) {
        arrays.take(rays);
        optix.trace(any_hit, nullptr);
        wait_for_default_stream("ray traversal by OptiX");
        answers.hits = arrays.hits();
    }
    answers.facts = optix.facts();
    answers.taken_bytes = int64_t(before - free_device_bytes()) -
                          int64_t(DeviceScene::predicted_bytes(scene) + rays.size() * (sizeof(Ray) + sizeof(Hit)));
    return answers;
}

OptixTimings time_rays_by_optix(const Scene& scene, const std::vector<RayBatch>& batches, int warm_ups,
                                int repetitions) {
    RayArrays arrays(scene);
    OptixTimings timings;
    for (const RayBatch& batch : batches) {
        KernelTiming timing = {"optix", "-", 0, 0.0};
        if (!batch.rays.empty()) {
            arrays.take(batch.rays);
            const auto launch = [&](size_t) { arrays.optix().trace(batch.any_hit, nullptr); };
            timing.seconds = median_seconds("ray traversal by OptiX", warm_ups, repetitions, {launch})[0];
            for (const Hit& hit : arrays.hits()) timing.hits += hit.prim != kNone;
        }
        timings.batches.push_back({timing});
    }
    timings.facts = arrays.optix().facts();
    return timings;
}

}  // namespace ambilux
