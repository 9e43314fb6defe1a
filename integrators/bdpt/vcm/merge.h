// merge: light vertices within the radius around an eye vertex, each a sample of the light that arrives there.
#pragma once

#include "integrators/bdpt/vcm/vertices.h"
#include "stages/arrival.h"

namespace ambilux {

/// What all merges of an eye vertex bring.
template <Features F>
struct MergeSum {
    const SceneView& scene;
    const Rules<MergingMis>& rules;
    const Vertex<MergingMis>& z;
    uint32_t most_depth;  ///< of light subpaths
    float radius;
    Rgb sum;

    /// Flux over an area is radiance times the cosine to that area.
    AMBILUX_HD void add(const MergeVertex& y) {
        const Vec3f d = octahedral_decode(y.d);
        const float cosine = fabsf(dot(z.point.ng, d));
        if (y.depth > most_depth || !(cosine > 0.0f)) return;
        const BsdfValue f = rules.directions.template evaluate<F>(z, -d, TransportMode::radiance);
        if (is_zero(f.value)) return;
        const float ratio = rules.mis.merge_ratio(y.sums(), y.depth == 1, z.sums, z.first, f);
        sum += f.value * y.flux * (mis_weight(ratio) / cosine);
    }
};

template <Features F>
struct Merge {
    static constexpr const char* kName = "merge";
    using Mis = MergingMis;
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<HitItem<typename Items::Ray>> hits;
    VcmState state;
    Accumulate samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const auto h = hits.load(i);
        if (h.prim == kNone) return;
        const Subpath<Mis> path = Items::unpack(h.ray);
        if (path.depth >= rules.max_depth || (path.depth == 1 && !rules.mis.merges_first)) return;
        const SurfacePoint point = surface_at<F>(scene, h.prim, h.u, h.v);
        const Vertex<Mis> z = vertex_at<F>(scene, rules, Side::eye, path, point);
        if (!bsdf_is_smooth(z.scattering.bsdf)) return;
        const float radius = rules.mis.now->radius;
        MergeSum<F> sum = {scene, rules, z, rules.max_depth - path.depth, radius, {0.0f, 0.0f, 0.0f}};
        for_each_near(point.p, radius, sum);
        const Rgb light = path.throughput * sum.sum * (1.0f / rules.mis.eta());
        if (!is_zero(light)) samples.push(Contribution{light, h.ray.path});
    }

private:
    AMBILUX_HD void for_each_near(Vec3f p, float radius, MergeSum<F>& sum) const {
        const MergeGrid grid = MergeGrid::of(scene, radius);
        const MergeCell first = grid.first_cell(p);
        for (int32_t k = 0; k < 8; ++k) {
            const MergeCell cell = {first.x + (k & 1), first.y + (k >> 1 & 1), first.z + (k >> 2)};
            const uint32_t place = cell.hash(state.table_bits), end = state.starts[place + 1];
            for (uint32_t i = state.starts[place]; i < end; ++i) {
                const MergeVertex y = state.sorted.load(i);
                if (length_squared(y.p - p) <= sqr(radius) && grid.cell(y.p) == cell) sum.add(y);
            }
        }
    }
};

}  // namespace ambilux
