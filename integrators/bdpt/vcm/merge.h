// merge: light vertices within the radius around an eye vertex, each a sample of the light that arrives there.
#pragma once

#include "integrators/bdpt/vcm/query_order.h"
#include "integrators/bdpt/vcm/vertices.h"
#include "stages/arrival.h"

namespace ambilux {

/// What all merges of an eye vertex bring.
template <Features F>
struct MergeSum {
    const SceneView& scene;
    const Rules<MergingMis>& rules;
    const Vertex<MergingMis>& z;
    const Subpath<MergingMis>& path;  ///< that ends at z
    uint32_t pixel;
    const Accumulate& samples;
    Rgb sum = {0.0f, 0.0f, 0.0f};

    /// Flux over an area is radiance times the cosine to that area.
    AMBILUX_HD void add(const MergeVertex& y) {
        const Vec3f d = octahedral_decode(y.d);
        const float cosine = fabsf(dot(z.point.ng, d));
        if (path.depth + y.front.depth > rules.max_depth || !(cosine > 0.0f)) return;
        const BsdfValue f = rules.directions.template evaluate<F>(z, -d, TransportMode::radiance);
        if (is_zero(f.value)) return;
        const float ratio = rules.mis.merge_ratio(y.sums(), y.front.depth == 1, z.sums, z.first, f);
        const float weight = mis_weight(ratio);
        sum += f.value * y.flux * (weight / cosine);
        if (samples.strategies.sums) gather(y, f.value * y.flux * (1.0f / cosine), weight);
    }
    /// What is added to the sample.
    AMBILUX_HD Rgb light(Rgb of_vertices) const { return path.throughput * of_vertices * (1.0f / rules.mis.eta()); }

private:
    /// For the image of this strategy.
    AMBILUX_HD void gather(const MergeVertex& y, Rgb value, float weight) const {
        const Wave& wave = samples.wave;
        samples.strategies.add_merge(y.front.depth + 1, path.depth + 1, wave.width * wave.height, pixel, light(value),
                                     light(value * weight));
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
        const auto hit = hits.load(i);
        at_mergeable<F>(scene, rules, Side::eye, hit, [&](const Subpath<Mis>& path, const Vertex<Mis>& z) {
            if (path.depth == 1 && !rules.mis.merges_first) return;
            const float radius = rules.mis.now->radius;
            const uint32_t pixel = wave.locate(hit.ray.path).pixel;
            MergeSum<F> sum = {scene, rules, z, path, pixel, samples};
            NearVertices near = {state, MergeGrid::of(scene, radius), z.point.p, radius};
            for (uint32_t k; (k = near.next()) != kNone;) sum.add(state.sorted.load(k));
            const Rgb light = sum.light(sum.sum);
            Accumulate gathered = samples;
            gathered.strategies = {};
            if (!is_zero(light)) gathered.push(Contribution{light, hit.ray.path});
        });
    }
};

/// Merge over vertices in order.
template <Features F>
struct MergeInOrder {
    static constexpr const char* kName = Merge<F>::kName;

    Merge<F> merge;
    QueryOrder order;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const { merge(order.at(i)); }
};

}  // namespace ambilux
