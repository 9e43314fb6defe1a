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
    Rgb sum;

    /// Flux over an area is radiance times the cosine to that area.
    AMBILUX_HD void add(const MergeVertex& y) {
        const Vec3f d = octahedral_decode(y.d);
        const float cosine = fabsf(dot(z.point.ng, d));
        if (y.front.depth > most_depth || !(cosine > 0.0f)) return;
        const BsdfValue f = rules.directions.template evaluate<F>(z, -d, TransportMode::radiance);
        if (is_zero(f.value)) return;
        const float ratio = rules.mis.merge_ratio(y.sums(), y.front.depth == 1, z.sums, z.first, f);
        sum += f.value * y.flux * (mis_weight(ratio) / cosine);
    }
};

/// Eye vertices of one depth in the order in which they merge on a device: those of a warp lie together, so that its
/// threads read the same light vertices. Below kLeast they stay as they are.
struct QueryOrder {
    static constexpr uint32_t kLeast = 1u << 15, kAxisBits = 8, kBits = 3 * kAxisBits;

    SortMemory<uint32_t> sort;
    const QueueCounter* queries;

    AMBILUX_HD bool sorted() const { return queries->size() >= kLeast; }
    AMBILUX_HD uint32_t at(uint32_t i) const { return sorted() ? sort.values[1][i] : i; }
    /// Along a Z curve through the scene's bounds.
    AMBILUX_HD static uint32_t key(const SceneView& scene, Vec3f p) {
        constexpr float kHalf = 1u << (kAxisBits - 1);
        const Vec3f c = (p - scene.bounds_center) * (kHalf / scene.bounds_radius) + splat(kHalf);
        return spread(c.x) | spread(c.y) << 1 | spread(c.z) << 2;
    }

private:
    /// The bits of a coordinate's cell, two apart.
    AMBILUX_HD static uint32_t spread(float x) {
        uint32_t cell = uint32_t(min(max(x, 0.0f), float((1u << kAxisBits) - 1)));
        cell = (cell | cell << 8) & 0x0000f00fu;
        cell = (cell | cell << 4) & 0x000c30c3u;
        return (cell | cell << 2) & 0x00249249u;
    }
};

template <Features F>
struct OrderQueries {
    static constexpr const char* kName = "order_queries";

    SceneView scene;
    Queue<HitItem<SubpathItems<MergingMis>::Ray>> hits;
    QueryOrder order;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (!order.sorted()) return;
        const auto hit = hits.load(i);
        const uint32_t none = (1u << QueryOrder::kBits) - 1;
        order.sort.keys[0][i] =
            hit.prim == kNone ? none : QueryOrder::key(scene, surface_at<F>(scene, hit.prim, hit.u, hit.v).p);
        order.sort.values[0][i] = i;
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
            MergeSum<F> sum = {scene, rules, z, rules.max_depth - path.depth, {0.0f, 0.0f, 0.0f}};
            NearVertices near = {state, MergeGrid::of(scene, radius), z.point.p, radius};
            for (uint32_t k; (k = near.next()) != kNone;) sum.add(state.sorted.load(k));
            const Rgb light = path.throughput * sum.sum * (1.0f / rules.mis.eta());
            if (!is_zero(light)) samples.push(Contribution{light, hit.ray.path});
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
