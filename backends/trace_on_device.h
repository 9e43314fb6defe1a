// Traces an array of rays on a CUDA device and brings the hits back: for tests, where the cost of copies does not
// matter.
#pragma once

#include <vector>

#include "backends/optix.h"
#include "scene/ray.h"
#include "scene/scene.h"

namespace ambilux {

/// Hits of `rays` on the device, through a structure built for this call: a CWBVH, or with `binary` a binary BVH.
/// Closest: as CwbvhTracer::closest. With `any_hit` only `prim` counts: kNone where a ray is free, 0 where it is
/// blocked. `persistent` chooses the kernel with dynamic fetch over the one with a thread per ray. Throws Error(device)
/// without a device.
std::vector<Hit> trace_on_device(const Scene& scene, const std::vector<Ray>& rays, bool any_hit, bool persistent,
                                 bool binary = false);

/// What OptiX answers (accel=optix), through a structure built for this call.
struct OptixAnswers {
    std::vector<Hit> hits;    ///< as those of trace_on_device
    int64_t taken_bytes = 0;  ///< that are gone from the device beside scene and rays: with the driver's own
    OptixFacts facts;
};
/// Throws Error(device) without a device or the driver's library, Error(usage) in a build without OptiX.
OptixAnswers trace_by_optix(const Scene& scene, const std::vector<Ray>& rays, bool any_hit);

}  // namespace ambilux
