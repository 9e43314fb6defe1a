// A few light walks on the host before the render: how many vertices a walk leaves.
#pragma once

#include "queues/wave.h"
#include "stages/bidirectional_policy.h"
#include "transport/walk.h"

namespace ambilux {

constexpr uint32_t kPilotWalks = 8192;

/// Vertices per light walk that connections may use, over kPilotWalks walks. The walks belong to no image: their
/// numbers come from a stream of their own, so that what the result decides is independent of the samples it is used
/// for. For the levels of features and the tracers of the host.
template <Features F, class Tracer>
double mean_light_vertices(const SceneView& scene, const Tracer& tracer, const BidirectionalPolicy& policy,
                           uint64_t seed);

/// Room for the light vertices of so many walks, from the mean of the pilot: a quarter more, and six deviations of a
/// geometric distribution.
inline uint32_t planned_vertices(double mean, uint64_t walks) {
    const double n = double(walks);
    return uint32_t(std::min(1.25 * mean * n + 6.0 * std::sqrt(n * mean * (mean + 1.0)) + 64.0, 4.0e9));
}

/// Completes the policy of variant lvc. A vertex of an eye walk draws k of the M vertices of N walks: it meets a given
/// walk's vertex k N / M times on average.
inline void plan_cache(BidirectionalPolicy& policy, double mean) {
    if (policy.cache_draws > 0 && mean > 0.0) policy.mis.connections = float(policy.cache_draws / mean);
}

}  // namespace ambilux
