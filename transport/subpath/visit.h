// One step of a subpath: what happens where its ray ends, for every integrator and schedule. Where results go is the
// sink's matter: queues (wavefront), registers (megakernel), moments (pilot), counts.
#pragma once

#include "transport/subpath/emission.h"
#include "transport/subpath/scatter.h"

namespace ambilux {

/// The ray of `path` ended at `hit`; a miss if hit.prim is kNone. Emission goes to sink.add(candidate); sink.numbers()
/// gives the random numbers of the subpath, late, so that no register keeps them before; sink.at(vertex, path, numbers)
/// is called where connections may start; sink.valid(throughput) may end the subpath. True if it goes on, with `path`
/// as the next ray. `longest`: segments that the subpath may have (Rules::longest, or fewer). No visibility and no loop
/// over connections: schedules hold one ray per slot.
template <Features F, class Mis, class Sink>
AMBILUX_HD bool visit(const SceneView& scene, const Rules<Mis>& rules, Side side, uint32_t longest, const Hit& hit,
                      Subpath<Mis>& path, const Sink& sink) {
    if (hit.prim == kNone) {
        Candidate<Mis> c;
        if (side == Side::eye && escape<F>(scene, rules, path, c)) sink.add(c);
        return false;
    }
    if (side == Side::eye && rules.background_only) return false;
    const SurfacePoint point = surface_at<F>(scene, hit.prim, hit.u, hit.v);
    if (side == Side::eye) {
        Candidate<Mis> c;
        if (emission<F>(scene, rules, path, point, c)) sink.add(c);
    }
    if (path.depth >= rules.max_depth) return false;
    const Vertex<Mis> vertex = vertex_at<F>(scene, rules, side, path, point);
    const NumbersOf<Mis> numbers = sink.numbers();
    if (bsdf_is_smooth(vertex.scattering.bsdf)) sink.at(vertex, path, numbers);
    if (path.depth >= longest) return false;
    return scatter<F>(rules, side, vertex, numbers.scatter(side, path.depth), path) && sink.valid(path.throughput);
}

}  // namespace ambilux
