// A whole subpath on a host, one step after the other: for pilots, replays and the twin. Schedules trace the rays of
// many subpaths together instead.
#pragma once

#include "transport/subpath/visit.h"

namespace ambilux {

/// Where the ray of `path` ends, at most `tmax` away.
template <Features F, class Mis, class Tracer>
Hit end_of_ray(const SceneView& scene, const Tracer& tracer, const Subpath<Mis>& path, float tmax,
               const NumbersOf<Mis>& numbers) {
    const uint32_t seed = F.opacity ? numbers.opacity_seed(path.depth) : 0;
    Hit hit = {tmax, 0.0f, 0.0f, kNone};
    tracer.template closest<F>(scene, Ray{path.origin, tmax, path.direction, seed}, hit);
    return hit;
}

/// The subpath whose first ray is `path`, of length `tmax`, until it ends. `extend(path, tmax)` says where a ray ends;
/// `longest` and `sink` are those of visit().
template <Features F, class Mis, class Extend, class Sink>
void trace_subpath(const SceneView& scene, const Rules<Mis>& rules, Side side, uint32_t longest, Subpath<Mis> path,
                   float tmax, const Extend& extend, const Sink& sink) {
    while (visit<F>(scene, rules, side, longest, extend(path, tmax), path, sink)) tmax = kInfinity;
}

}  // namespace ambilux
