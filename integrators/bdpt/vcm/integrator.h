// vcm: vertex connection and merging (Georgiev et al. 2012; Hachisuka et al. 2012). Light subpaths of all waves of an
// iteration leave vertices, which are sorted into cells; eye subpaths merge with those nearby, and are connected with
// some that they draw.
#pragma once

#include "integrators/bdpt/shared/two_sides.h"
#include "integrators/bdpt/vcm/merge.h"
#include "integrators/bdpt/vcm/merging_directions.h"
#include "integrators/bdpt/vcm/pixel_radius.h"
#include "integrators/bdpt/vcm/source.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion, class MisModel>
struct VcmOf {
    using Mis = MisModel;
    using Policy = VcmPolicyOf<Mis>;
    using State = VcmStateOf<Mis>;
    static constexpr bool kFilmWide = true;
    static constexpr uint32_t kPhases = 2;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p = Policy::plan(scene, settings);
        p.vertex_lanes = ConnectionVertex<Mis>::template lanes<F>();
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        if (!p.light_subpaths()) return 0.0;
        const float pixel = p.vcm.asks_pixels() ? pixel_radius<F>(scene, tracer) : 0.0f;
        p.first_radius = p.vcm.first_radius(scene.bounds_radius, pixel);
        if (p.vcm.unit == RadiusUnit::footprint && !p.vcm.open_radius() && pixel < kInfinity) {
            constexpr float kLeastFootprint = 0.01f;
            p.rules.mis.largest_footprint = kLargestFootprint * pixel;
            p.rules.mis.least_area =
                fminf(sqr(fmaxf(kLeastFootprint, kLeastRadius * scene.bounds_radius / p.first_radius)), 1.0f);
        }
        const double mean = mean_light_vertices<F>(scene, tracer, p.rules, seed);
        if (p.cache_draws > 0 && mean > 0.0) p.rules.mis.connections = float(p.cache_draws / mean);
        p.size_table(mean);
        return mean;
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies<Mis>(scene, p);
    }

    struct Memory {
        TwoSidesMemory<Mis> two_sides;
        VcmVerticesOf<Mis> kept;
        MergeNow* now;
        SortMemory<uint32_t> queries;
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        Memory m;
        m.two_sides = TwoSidesMemory<Mis>::template lay_out<kFusion, F>(layout, p, n);
        m.kept = VcmVerticesOf<Mis>::lay_out(layout, "wave_merge_vertices", p, n.kept);
        m.kept.keys = layout.allocate<uint64_t>(m.kept.merges.capacity());
        m.now = layout.allocate<MergeNow>(1);
        m.queries =
            SortMemory<uint32_t>::lay_out(layout, p.keeps_vertices && !kFusion.occlude ? n.slots : 0, n.primitives);
        return m;
    }

    struct Stages {
        TwoSidesStages<F, Tracer, kFusion, VcmSourceOf<Mis>> two_sides;
        bool keeps;
        SetRadius set_radius;
        KeepVertices<F, Mis> keep[2];
        AppendVertices<Mis> append;
        StageRecord* sort;
        FindCells<Mis> find;
        PlaceVertices<Mis> place;
        OrderQueries<F, Mis> order[2];
        Merge<F, Mis> merge[2];

        Stages(const WaveParts<Tracer>& parts, const Policy& plan, const Memory& m, const State& state)
            : Stages(parts, m, state, with(plan, m.now)) {}

    private:
        /// Weights know the radius of the iteration.
        static Policy with(Policy p, const MergeNow* now) {
            p.rules.mis.now = now;
            return p;
        }
        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Memory& m, const State& state, const Policy& p)
            : two_sides(parts, p, m.two_sides, VcmSourceOf<Mis>::of(state, parts.wave.state, p)),
              keeps(p.keeps_vertices) {
            const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
            const SceneView& scene = parts.scene;
            const auto& hits = m.two_sides.subpaths.hits;
            set_radius = {parts.wave.state, m.now, p.first_radius, p.vcm.alpha, p.subpaths(), record(set_radius)};
            for (int k = 0; k < 2; ++k) {
                keep[k] = {scene,       parts.wave, p.rules,         hits[k],         m.kept,         m.now,
                           p.numbers(), p.keys,     p.rules.connect, p.keeps_first(), record(keep[k])};
                order[k] = {scene,
                            parts.wave,
                            p.numbers(),
                            hits[k],
                            {m.queries, hits[k].counter},
                            QueryOrder::kPlaceBits + uint32_t(std::bit_width(p.waves.iterations_together - 1)),
                            record(order[k])};
                merge[k] = {scene,           parts.wave, p.rules, p.numbers(), hits[k], state, two_sides.eye.accumulate,
                            record(merge[k])};
            }
            append = {m.kept, state, record(append)};
            sort = parts.layout.record("sort_vertices");
            find = {state, parts.wave.state, p.vcm.samples, record(find)};
            place = {state, record(place)};
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& s) { light_subpaths(exec, s); });
        run.once([](auto& exec, const Stages& s) {
            if (!s.keeps) return;
            const uint32_t count = exec.count(s.append.state.all.merges);
            exec.sort_pairs(s.append.state.order, count, s.append.state.key_bits(), s.sort);
            exec.for_each(s.find, count + 1);
            exec.for_each(s.place, count);
        });
        run.for_waves([](auto& exec, const Stages& s) { eye_subpaths(exec, s); });
        run.once([](auto& exec, const Stages& s) {
            if (s.keeps) exec.clear(s.append.state.all.merges);
        });
    }

private:
    template <class Executor>
    static void light_subpaths(Executor& exec, const Stages& s) {
        const auto& all = s.two_sides;
        if (all.policy.rules.max_depth == 0 || !all.policy.light_subpaths()) return;
        exec.for_each(s.set_radius, 1);
        run_light_subpaths(exec, all.light, all.splats, all.policy, [&](int k, const auto& vertex) {
            if (!s.keeps) return;
            KeepVertices<F, Mis> keep = s.keep[k];
            keep.wave.first_key = vertex.wave.first_key;
            exec.for_each(keep, keep.hits);
        });
        if (s.keeps) {
            exec.fail_on_overflow(s.append.mine.merges, s.append.mine.merges);
            exec.append(s.append, all.splats.splat.items());
            exec.clear(s.append.mine.merges);
        }
        if (all.policy.rules.splat) exec.run(all.splats.splat);
    }
    template <class Executor>
    static void eye_subpaths(Executor& exec, const Stages& s) {
        const auto& all = s.two_sides;
        if (all.policy.rules.max_depth == 0) return;
        exec.for_each(s.set_radius, 1);
        run_eye_subpaths(exec, all, [&](int k, const auto&) {
            if (s.keeps) merge(exec, s.order[k], s.merge[k]);
        });
    }
    template <class Executor>
    static void merge(Executor& exec, const OrderQueries<F, Mis>& order, const Merge<F, Mis>& merge) {
        if constexpr (Executor::kHost) {
            exec.for_each(merge, merge.hits);
        } else {
            exec.for_each(order, merge.hits);
            exec.sort_pairs(order.order.sort, merge.hits, order.bits, merge.record, QueryOrder::kLeast);
            exec.for_each(MergeInOrder<F, Mis>{merge, order.order, merge.record}, merge.hits);
        }
    }
};

template <Features F, class Tracer, Fusion K>
using VcmIntegrator = VcmOf<F, Tracer, K, MergingMis>;

/// The same, with what their names switch off.
template <Features F, class Tracer, Fusion K>
using BpmIntegrator = VcmIntegrator<F, Tracer, K>;
template <Features F, class Tracer, Fusion K>
using PpmIntegrator = VcmIntegrator<F, Tracer, K>;
template <Features F, class Tracer, Fusion K>
using SppmIntegrator = VcmIntegrator<F, Tracer, K>;
template <Features F, class Tracer, Fusion K>
using PmIntegrator = VcmIntegrator<F, Tracer, K>;

}  // namespace ambilux
