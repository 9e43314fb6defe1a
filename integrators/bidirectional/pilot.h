// A few light walks on the host before the render: how many vertices a walk leaves.
#pragma once

#include <atomic>

#include "core/parallel.h"
#include "stages/bidirectional_policy.h"
#include "stages/wave.h"
#include "transport/walk.h"

namespace ambilux {

constexpr uint32_t kPilotWalks = 8192, kPilotGrain = 64;

/// Vertices per light walk that connections may use, over kPilotWalks walks. The walks belong to no image: their numbers come from a stream of their own, so that what the result decides is
/// independent of the samples it is used for.
template <Features F, class Tracer>
double mean_light_vertices(const SceneView& scene, const Tracer& tracer, const BidirectionalPolicy& policy, uint64_t seed) {
    std::atomic<uint64_t> vertices = 0;
    parallel_for(
        kPilotWalks,
        [&](uint32_t i) {
            const RngKey key = {seed, i, 0, Stream::pilot};
            const Vec4f direction = random_floats(key, kEmissionBlock + 1);
            EmissionSample e;
            if (!sample_emission<F>(scene, random_floats(key, kEmissionBlock), {direction.x, direction.y}, e)) return;
            uint32_t left = 0;
            for (Walk w = start_light_walk(e);;) {
                Hit hit;
                Ray ray = {w.o, kInfinity, w.d, alpha_seed(key, w.depth, false)};
                if (!tracer.template closest<F>(scene, ray, hit)) break;
                const WalkVertex y = light_vertex<F>(scene, policy.mis, w, hit.prim, hit.u, hit.v);
                if (w.depth + 2 > policy.max_depth) break;
                left += bsdf_is_smooth(y.scattering.bsdf);
                if (!scatter_walk<F>(policy.mis, y, random_floats(key, light_scatter_block(w.depth)), TransportMode::importance, policy.rr_depth, w)) break;
            }
            vertices.fetch_add(left, std::memory_order_relaxed);
        },
        kPilotGrain);
    return double(vertices.load()) / kPilotWalks;
}

/// Room for the light vertices of `slots` walks, from the mean of the pilot: a quarter more, and six deviations of a geometric distribution.
inline uint32_t planned_vertices(double mean, uint32_t slots) {
    const double n = double(slots);
    return uint32_t(std::min(1.25 * mean * n + 6.0 * std::sqrt(n * mean * (mean + 1.0)) + 64.0, 4.0e9));
}

/// Completes the policy of variant lvc. A vertex of an eye walk draws k of the M vertices of N walks: it meets a given walk's vertex k N / M times on average.
inline void plan_cache(BidirectionalPolicy& policy, double mean) {
    if (policy.cache_draws > 0 && mean > 0.0) policy.mis.connections = float(policy.cache_draws / mean);
}

}  // namespace ambilux
