// Times of the traversal kernels on arrays of rays.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "accel/cwbvh.h"
#include "accel/pair_bvh.h"
#include "backends/optix.h"
#include "backends/ray_batches.h"
#include "scene/scene.h"

namespace ambilux {

struct KernelTiming {
    std::string kernel, tuning;
    uint64_t hits;   ///< rays that met something
    double seconds;  ///< median of one run over the whole batch
};

/// For each batch, every kernel that can trace it: the persistent one with the tuning that suits the batch, with the
/// other, and the plain one. Throws Error(device).
std::vector<std::vector<KernelTiming>> time_rays_on_device(const Scene& scene, const CwbvhArrays& cwbvh,
                                                           const std::vector<RayBatch>& batches, int warm_ups,
                                                           int repetitions);
std::vector<std::vector<KernelTiming>> time_rays_on_device(const Scene& scene, const PairArrays& pairs,
                                                           const std::vector<RayBatch>& batches, int warm_ups,
                                                           int repetitions);

struct OptixTimings {
    std::vector<std::vector<KernelTiming>> batches;
    OptixFacts facts;
};
/// The same by OptiX (accel=optix). Throws Error(usage) in a build without it.
OptixTimings time_rays_by_optix(const Scene& scene, const std::vector<RayBatch>& batches, int warm_ups,
                                int repetitions);

}  // namespace ambilux
