// Light of the grids at the first vertex of an eye subpath that is no delta.
#pragma once

#include "stages/arrival.h"
#include "state.h"
#include "transport/subpath/visit.h"

namespace ambilux::lpv {

/// Irradiance at a surface with unit normal `n`, from the finest grid that holds the place half a cell before it, mixed
/// with the next one near its border. The flux of a cell is taken to cross the area of a face: what the steps conserve
/// arrives. (The paper takes it to come from half an edge away, and leaves a factor to the user.)
AMBILUX_HD Rgb irradiance(const Cascades& cascades, const Intensity* total, Vec3f p, Vec3f n) {
    Rgb sum = {0.0f, 0.0f, 0.0f};
    float rest = 1.0f;
    for (uint32_t c = cascades.count; c-- > 0 && rest > 0.0f;) {
        const Grid& grid = cascades.grids[c];
        const Vec3f q = p + n * (0.5f * grid.cell);
        const float weight = c > 0 ? rest * grid.weight(q) : rest;
        if (!(weight > 0.0f)) continue;
        const Rgb flux = grid.interpolate(total + c * grid.cells(), q).cosine_integral(-n);
        sum += max(flux, splat(0.0f)) * (weight / sqr(grid.cell));
        rest -= weight;
    }
    return sum;
}

/// The BSDF counts as a diffuse one of the albedo for the direction of the eye subpath: one sample of it estimates
/// that, and says on which side. A sample of a delta gathers nothing; the eye subpath goes on with the same one.
template <Features F, class Mis>
struct Gather {
    static constexpr const char* kName = "gather";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Cascades cascades;
    Queue<HitItem<typename Items::Ray>> hits;
    const Intensity* total;
    Accumulate samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const auto h = hits.load(i);
        if (h.prim == kNone) return;
        const Subpath<Mis> path = Items::unpack(h.ray);
        if (path.depth + 2 > rules.max_depth) return;
        const Vertex<Mis> z = vertex_at<F>(scene, rules, Side::eye, path, surface_at<F>(scene, h.prim, h.u, h.v));
        const Vec4f u = NumbersOf<Mis>{wave.key(h.ray.path)}.scatter(Side::eye, path.depth);
        ScatterSample s;
        if (!scatter_sample<F>(z.scattering, {u.x, u.y, u.z}, TransportMode::radiance, s) || s.flags & kScatterDelta)
            return;
        const Vec3f n = z.scattering.frame.n;
        const Rgb light = irradiance(cascades, total, z.point.p, dot(n, s.wo) < 0.0f ? -n : n) * kInvPi;
        samples.push(Contribution{path.throughput * s.weight * light, h.ray.path});
    }
};

}  // namespace ambilux::lpv
