// A few light subpaths on the host before the render: how many vertices one leaves.
#pragma once

#include "accel/host_tracer.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/rules.h"

namespace ambilux {

constexpr uint32_t kPilotSubpaths = 8192;

/// Mean number of vertices of a light subpath that connections may use, over kPilotSubpaths. They belong to no image:
/// their random numbers come from a stream of their own, so that what the result decides is independent of the samples
/// it is used for. For all feature levels.
template <Features F>
double mean_light_vertices(const SceneView& scene, const HostTracer& tracer, const Rules<BidirectionalMis>& rules,
                           uint64_t seed);
template <Features F, class Mis>
    requires(!std::is_same_v<Mis, BidirectionalMis>)
double mean_light_vertices(const SceneView& scene, const HostTracer& tracer, const Rules<Mis>& rules, uint64_t seed) {
    // Light subpaths begin by power, whatever next event estimation does; a mean needs no even points.
    constexpr Features kOwn = [] {
        Features f = F;
        f.sampling = false;
        return f;
    }();
    return mean_light_vertices<kOwn>(scene, tracer, rules.with(BidirectionalMis(rules.mis)), seed);
}

}  // namespace ambilux
