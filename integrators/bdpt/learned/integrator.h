// bdpt, variant learned: a cache of light vertices as in lvc, from which eye vertices draw as earlier passes have
// taught (stages/learned_draws.h).
#pragma once

#include "integrators/bdpt/learned/cells.h"
#include "integrators/bdpt/learned/settings.h"
#include "integrators/bdpt/shared/two_sides.h"
#include "stages/cluster_light_vertices.h"
#include "stages/update_draws.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct LearnedIntegrator {
    static constexpr bool kFilmWide = true;
    static constexpr const char* kLearnName = UpdateDraws::kName;

    struct Policy : BdptPolicy {
        LearnedSettings learned;
        DrawCells found;
        DrawTable table;
    };
    struct Memory {
        TwoSidesMemory<BidirectionalMis, ScoredShadowItem> two_sides;
        ClusteredVertices by_cluster;
    };
    struct Stages {
        TwoSidesStages<F, Tracer, kFusion, LearnedSource> two_sides;
        CountClusters count;
        PlaceClusters place;
        SortByCluster sort;

        Stages(Layout& layout, const SceneView& scene, const Tracer& tracer, const Policy& p, const Wave& wave,
               const Memory& m, const FilmBuffers& film)
            : two_sides(layout, scene, tracer, p, wave, m.two_sides, film,
                        {m.two_sides.light_vertices, p.cache_draws, m.by_cluster, p.table}) {
            StageRecord* const record = layout.record(CountClusters::kName);
            count = {two_sides.source, record};
            place = {two_sides.source, record};
            sort = {two_sides.source, record};
        }
    };

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p{plan_bdpt(scene, settings), LearnedSettings::plan(settings), {}, {}};
        if (!p.rules.connect) return p;
        p.cache_draws = settings.connections;
        p.one_connection_per_launch |= p.cache_draws == 1;
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        if (!p.light_subpaths()) return 0.0;
        p.found = find_draw_cells<F>(scene, tracer, p.rules, seed, kCellLevels, kClusterLevels);
        const double mean = p.found.mean_light_vertices;
        if (p.cache_draws > 0 && mean > 0.0) p.rules.mis.connections = p.learned.weight * float(p.cache_draws / mean);
        return mean;
    }
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        Memory m;
        m.two_sides = decltype(m.two_sides)::template lay_out<kFusion, F>(layout, p, n);
        const uint32_t kept = p.rules.connect ? n.kept : 0, clusters = p.rules.connect ? kClusters : 0,
                       parts = clusters * ClusteredVertices::kParts;
        m.by_cluster = {layout.allocate<uint32_t>(clusters + 1), layout.allocate<uint32_t>(parts),
                        layout.allocate<uint32_t>(parts),        layout.allocate<uint32_t>(kept),
                        layout.allocate<uint16_t>(kept),         layout.allocate<uint32_t>(kept)};
        return m;
    }
    /// What all waves share and keep from one to the next.
    static void lay_out_kept(Layout& layout, Policy& p) {
        if (!p.rules.connect) return;
        p.table = {{layout.allocate<DrawSplit>(kCells), kCellLevels},
                   {layout.allocate<DrawSplit>(kClusters), kClusterLevels},
                   layout.allocate<uint16_t>(kCells * kClusters),
                   layout.allocate<int64_t>(kCells * kClusters),
                   0x1p20f / p.found.unit};
    }
    /// copy(place, values) puts there what is known before the first wave; the rest is zero.
    template <class Copy>
    static void fill_kept(const Policy& p, Copy copy) {
        if (!p.rules.connect) return;
        copy(p.table.cells.splits, p.found.cells);
        copy(p.table.clusters.splits, p.found.clusters);
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies(scene, p);
    }
    template <class Executor>
    static void schedule(Executor& exec, const Stages& all) {
        const auto& s = all.two_sides;
        if (s.policy.rules.max_depth == 0) return;
        if (s.policy.light_subpaths()) run_light_subpaths(exec, s.light, s.splats, s.policy);
        if (s.policy.rules.connect) {
            exec.run_paths(all.count, 1);
            exec.run_paths(all.place, 1);
            exec.run_paths(all.sort, 1);
        }
        run_eye_subpaths(exec, s);
        if (s.policy.rules.splat) exec.run(s.splats.splat);
        if (s.policy.rules.connect) exec.clear(s.source.vertices);
    }
    /// Runs after all waves of a sample, over items_to_learn items.
    static UpdateDraws learn(const Policy& p, const WaveState* state, StageRecord* record) {
        return {p.table, state, p.learned.share, record};
    }
    static uint32_t items_to_learn(const Policy& p) { return p.rules.connect ? kCells >> UpdateDraws::kGroupBits : 0; }

private:
    static constexpr uint32_t kCellLevels = 9, kClusterLevels = 8, kCells = 1u << kCellLevels,
                              kClusters = 1u << kClusterLevels;
};

}  // namespace ambilux
