// Times of operations on queues on a CUDA device.
#pragma once

#include <vector>

#include "backends/bench_queue_stages.h"
#include "scene/scene.h"

namespace ambilux {

/// The rows of bench_queues (backends/bench_queues.h). `hits` and `rays`: to be sorted by material and by Morton code,
/// each with its index as its path. Throws Error(device).
std::vector<QueueTiming> time_queues_on_device(const Scene& scene, uint32_t items, const std::vector<PathHit>& hits,
                                               const std::vector<PathRay>& rays, int warm_ups, int repetitions);

}  // namespace ambilux
