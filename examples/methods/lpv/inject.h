// Virtual lights, and how they become the light of cells.
#pragma once

#include "stages/stage.h"
#include "state.h"
#include "transport/subpath/visit.h"

namespace ambilux::lpv {

/// A light subpath ends at the first surface that it meets and leaves a virtual light there: a Lambertian one of the
/// flux that one sample of the BSDF keeps, on the side of that sample. Exact where the BSDF is diffuse. Deltas leave
/// none.
template <Features F, class Mis>
struct LeaveLight {
    static constexpr const char* kName = "leave_light";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<HitItem<typename Items::Ray>> hits;
    VirtualLight* lights;
    uint32_t iteration_samples;
    float subpaths;  ///< of the iteration
    StageRecord* record;

    const Queue<HitItem<typename Items::Ray>>& items() const { return hits; }
    AMBILUX_HD void operator()(uint32_t i) const {
        const auto h = hits.load(i);
        if (h.prim == kNone) return;
        const Subpath<Mis> path = Items::unpack(h.ray);
        const Vertex<Mis> y = vertex_at<F>(scene, rules, Side::light, path, surface_at<F>(scene, h.prim, h.u, h.v));
        const Vec4f u = NumbersOf<Mis>{wave.key(h.ray.path, Stream::light)}.scatter(Side::light, path.depth);
        ScatterSample s;
        // What absorbs blocks too.
        if (!scatter_sample<F>(y.scattering, {u.x, u.y, u.z}, TransportMode::importance, s))
            s = {-path.direction, 0.0f, 0.0f, {0.0f, 0.0f, 0.0f}, 1.0f, 0};
        if (s.flags & kScatterDelta) return;
        const Rgb flux = path.throughput * s.weight * (1.0f / subpaths);
        if (!is_valid_radiance(flux, record)) return;
        const Vec3f n = y.scattering.frame.n;
        const PathSlot p = wave.locate(h.ray.path);
        const uint32_t first = wave.state->iteration * iteration_samples;
        lights[(p.sample - first) * wave.width * wave.height + p.pixel] = {y.point.p, dot(n, s.wo) < 0.0f ? -n : n,
                                                                           flux, wave.state->iteration + 1};
    }
};

/// Which site of each grid a virtual light belongs to, as a key to sort by. As a light, to the cell half an edge
/// before its surface, which then does not light itself; as a blocker, to the nearest corner of cells. Sorts are
/// stable: in a site, lights stay in the order of their light subpaths, which knows nothing of waves and threads, so
/// that sums have the same bits for any number of them.
struct FindSites {
    static constexpr const char* kName = "find_sites";

    Wave wave;
    Cascades cascades;
    State state;
    uint32_t lights;
    bool blockers;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t c = i / lights;
        const VirtualLight& light = state.lights[i - c * lights];
        const Grid& grid = cascades.grids[c];
        const uint32_t along = grid.resolution + blockers;
        const Vec3f p = grid.in_cells(light.p) + (blockers ? splat(0.5f) : light.n * 0.5f);
        const uint32_t here = light.iteration == wave.state->iteration + 1 ? Grid::site_at(p, along) : kNone;
        state.order.keys[0][i] = here == kNone ? 0 : c * along * along * along + here + 1;
        state.order.values[0][i] = i - c * lights;
    }
};

/// The virtual lights of a site in their order, once they are sorted. `count`: pairs of all grids.
template <class Use>
AMBILUX_HD void for_lights(const State& state, uint32_t count, uint32_t site, Use use) {
    const uint32_t* keys = state.order.keys[1];
    for (uint32_t i = lower_bound(keys, count, site + 1); i < count && keys[i] == site + 1; ++i)
        use(state.lights[state.order.values[1][i]]);
}

/// What virtual lights send from a cell, and its light before the first step: that, or what the larger grid holds
/// there, which further steps refine.
struct Inject {
    static constexpr const char* kName = "inject";

    Cascades cascades;
    State state;
    uint32_t count, cascade;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t place = cascade * cascades.grids[cascade].cells() + i;
        Intensity sum = {};
        for_lights(state, count, place,
                   [&](const VirtualLight& light) { sum.add_cosine(light.flux * kInvPi, light.n); });
        state.injected[i] = sum;
        if (cascade > 0) sum = cascades.from_larger(state.total, cascade, cascades.grids[cascade].cell_of(i));
        state.light[0][i] = state.total[place] = sum;
    }
};

/// What is blocked at a corner of cells: that which flows towards the mean surface there. No light subpath tells how
/// large that is; it is taken to be as large as a face of a cell.
struct Block {
    static constexpr const char* kName = "block";

    State state;
    uint32_t count;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        Harmonics<float> sum = {}, mean = {};
        float lights = 0.0f;
        for_lights(state, count, i, [&](const VirtualLight& light) {
            sum.add_cosine(1.0f, -light.n);
            lights += 1.0f;
        });
        if (lights > 0.0f) mean.add(1.0f / lights, sum);
        state.blocking[i] = mean;
    }
};

}  // namespace ambilux::lpv
