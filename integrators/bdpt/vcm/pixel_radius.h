// How far a pixel reaches where the camera looks: what is smaller than that no image shows.
#pragma once

#include <algorithm>
#include <vector>

#include "accel/host_tracer.h"
#include "integrators/bdpt/vcm/merging_mis.h"
#include "transport/subpath/start.h"
#include "transport/subpath/trace.h"

namespace ambilux {

/// Radius of the disk across the camera ray that has the area of a pixel's footprint at the first hit, the median over
/// pixels; infinite if nothing is seen. The same for every seed.
template <Features F>
[[gnu::cold]] float pixel_radius(const SceneView& scene, const HostTracer& tracer) {
    constexpr uint32_t kRays = 1024, kStep = 0x9e3779b1u;
    const Sensor& sensor = scene.sensor;
    const uint64_t pixels = uint64_t(sensor.crop_width) * sensor.crop_height;
    const BidirectionalMis mis{};
    std::vector<float> radii;
    for (uint32_t i = 0; i < kRays; ++i) {
        const uint32_t pixel = uint32_t(uint64_t(i) * kStep % pixels);
        const RandomNumbers numbers = {{0, i, 0, Stream::pilot}};
        float tmax = 0.0f;
        const Subpath<BidirectionalMis> path =
            start_eye_subpath<F>(scene, mis, pixel % sensor.crop_width, pixel / sensor.crop_width, numbers, tmax);
        const Hit hit = end_of_ray<F>(scene, tracer, path, tmax, numbers);
        if (hit.prim == kNone) continue;
        radii.push_back(
            footprint_radius<F>(sensor, camera_cosine<F>(sensor, path.direction), hit.t + path.start.camera_distance));
    }
    if (radii.empty()) return kInfinity;
    const auto median = radii.begin() + radii.size() / 2;
    std::nth_element(radii.begin(), median, radii.end());
    return *median;
}

}  // namespace ambilux
