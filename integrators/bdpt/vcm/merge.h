// merge: light vertices within the radius around an eye vertex, each a sample of the light that arrives there.
#pragma once

#include "integrators/bdpt/vcm/query_order.h"
#include "integrators/bdpt/vcm/vertices.h"
#include "stages/arrival.h"

namespace ambilux {

/// What one light vertex brings.
struct MergeFound {
    Rgb value;  ///< flux times BSDF
    float cosine, ratio;

    AMBILUX_HD Rgb times(float weight) const { return value * (weight / cosine); }
};

/// What all merges of an eye vertex bring.
template <Features F, class Mis = MergingMis>
struct MergeSum {
    const SceneView& scene;
    const Rules<Mis>& rules;
    const Vertex<Mis>& z;
    const Subpath<Mis>& path;  ///< that ends at z
    Rgb sum = {0.0f, 0.0f, 0.0f};

    AMBILUX_HD void add(const MergeFound& m) { sum += m.times(mis_weight(m.ratio)); }
    /// False if `y` brings nothing. Flux over an area is radiance times the cosine to that area.
    AMBILUX_HD bool find(const MergeVertexOf<Mis>& y, MergeFound& m) const {
        const Vec3f d = octahedral_decode(y.d);
        m.cosine = fabsf(dot(z.point.ng, d));
        if (path.depth + y.front.depth > rules.max_depth || !(m.cosine > 0.0f)) return false;
        const BsdfValue f = rules.directions.template evaluate<F>(z, -d, TransportMode::radiance);
        if (is_zero(f.value)) return false;
        m.ratio = rules.mis.merge_ratio(y.sums(), y.front.depth == 1, z.sums, z.first, f);
        m.value = f.value * y.flux;
        return true;
    }
    /// What `found` by light vertices adds to the sample.
    AMBILUX_HD Rgb light(Rgb found) const { return path.throughput * found * (1.0f / rules.mis.eta(z.sums)); }
};

template <Features F, class Mis>
struct Merge {
    static constexpr const char* kName = "merge";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    IterationNumbers numbers;
    Queue<HitItem<typename Items::Ray>> hits;
    VcmStateOf<Mis> state;
    Accumulate samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const auto hit = hits.load(i);
        at_mergeable<F>(scene, rules, Side::eye, hit, [&](const Subpath<Mis>& path, const Vertex<Mis>& z) {
            if (path.depth == 1 && !rules.mis.merges_first) return;
            MergeSum<F, Mis> sum = {scene, rules, z, path};
            NearVertices<Mis> near = {state, MergeGrid::of(scene, rules.mis.now->radius),
                                      numbers.iteration(wave, hit.ray.path), z.point.p, rules.mis.radius(z.sums)};
            for (uint32_t k; (k = near.next()) != kNone;) {
                const MergeVertexOf<Mis> y = state.sorted.load(k);
                MergeFound m;
                if (!sum.find(y, m)) continue;
                sum.add(m);
                if (samples.strategies.sums) remember(sum, m, y.front.depth + 1, path.depth + 1, hit.ray.path);
            }
            const Rgb light = sum.light(sum.sum);
            if (!is_zero(light)) samples.add(Contribution{light, hit.ray.path});
        });
    }

private:
    /// For the image of this strategy.
    AMBILUX_HD void remember(const MergeSum<F, Mis>& sum, const MergeFound& m, uint32_t s, uint32_t t,
                             uint32_t slot) const {
        samples.strategies.add_merge(s, t, wave.width * wave.height, wave.locate(slot).pixel, sum.light(m.times(1.0f)),
                                     sum.light(m.times(mis_weight(m.ratio))));
    }
};

/// Merge over vertices in order.
template <Features F, class Mis>
struct MergeInOrder {
    static constexpr const char* kName = Merge<F, Mis>::kName;

    Merge<F, Mis> merge;
    QueryOrder order;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const { merge(order.at(i)); }
};

}  // namespace ambilux
