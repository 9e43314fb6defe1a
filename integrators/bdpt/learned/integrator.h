// bdpt, variant learned: a cache of light vertices as in lvc, from which eye vertices draw in proportion to what
// earlier iterations have found (draws.h).
#pragma once

#include "integrators/bdpt/learned/cluster_light_vertices.h"
#include "integrators/bdpt/learned/state.h"
#include "integrators/bdpt/learned/update_draws.h"
#include "integrators/bdpt/shared/two_sides.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct LearnedIntegrator {
    using Policy = LearnedPolicy;
    using State = LearnedState;
    using TwoSides = TwoSidesMemory<BidirectionalMis, LearnDraws>;
    static constexpr bool kFilmWide = true;
    static constexpr uint32_t kPhases = 1;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p{plan_bdpt(scene, settings), LearnedSettings::plan(settings), {}};
        if (!p.rules.connect) return p;
        p.cache_draws = settings.connections;
        p.one_connection_per_launch |= p.cache_draws == 1;
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        if (!p.light_subpaths()) return 0.0;
        p.found = find_draw_cells<F>(scene, tracer, p.rules, seed, State::kCellLevels, State::kClusterLevels);
        const double mean = p.found.mean_light_vertices;
        if (p.cache_draws > 0 && mean > 0.0) p.rules.mis.connections = p.learned.weight * float(p.cache_draws / mean);
        return mean;
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies(scene, p);
    }

    struct Memory {
        TwoSides two_sides;
        ClusteredVertices by_cluster;
    };
    static Memory lay_out(Layout& layout, const Policy& p, const WaveSize& n) {
        Memory m;
        m.two_sides = TwoSides::template lay_out<kFusion, F>(layout, p, n);
        if (!p.rules.connect) return m;
        m.by_cluster.first = layout.allocate<uint32_t>(State::kClusters + 1);
        m.by_cluster.sort = SortMemory<uint16_t>::lay_out(layout, n.kept, n.primitives);
        return m;
    }

    struct Stages {
        TwoSidesStages<F, Tracer, kFusion, LearnedSource> two_sides;
        KeyByCluster key;
        FindClusters find;
        UpdateDraws update;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State& state)
            : two_sides(parts, p, m.two_sides,
                        LearnedSource{m.two_sides.light_vertices, p.cache_draws, m.by_cluster, state.table}) {
            StageRecord* const record = parts.layout.record(KeyByCluster::kName);
            key = {two_sides.source, record};
            find = {two_sides.source, record};
            update = {state.table, parts.wave.state, p.learned.share, parts.layout.record(UpdateDraws::kName)};
        }
    };

    template <class Run>
    static void iteration(Run& run) {
        run.for_waves([](auto& exec, const Stages& all) { subpaths(exec, all); });
        run.once([](auto& exec, const Stages& all) {
            if (all.two_sides.policy.rules.connect) exec.for_each(all.update, State::kCells >> UpdateDraws::kGroupBits);
        });
    }

private:
    /// One wave.
    template <class Executor>
    static void subpaths(Executor& exec, const Stages& all) {
        const auto& s = all.two_sides;
        if (s.policy.rules.max_depth == 0) return;
        if (s.policy.light_subpaths()) run_light_subpaths(exec, s.light, s.splats, s.policy);
        if (s.policy.rules.connect) {
            exec.for_each(all.key, s.source.vertices);
            exec.sort_pairs(s.source.by_cluster.sort, s.source.vertices,
                            State::kClusterLevels + ClusteredVertices::kPartBits, all.key.record);
            exec.for_each(all.find, State::kClusters + 1);
        }
        run_eye_subpaths(exec, s);
        if (s.policy.rules.splat) exec.run(s.splats.splat);
        if (s.policy.rules.connect) exec.clear(s.source.vertices);
    }
};

}  // namespace ambilux
