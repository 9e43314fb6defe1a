// bdpt, variant lvc: eye vertices draw from a cache of the light vertices of all light subpaths of the wave (Davidovic
// et al. 2014).
#pragma once

#include "integrators/bdpt/shared/two_sides.h"
#include "transport/mis/by_sobol.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion, class Mis>
struct LvcOf {
    using Policy = BdptPolicyOf<Mis>;
    using State = NoState;
    using Memory = TwoSidesMemory<Mis>;
    using Stages = TwoSidesStages<F, Tracer, kFusion, LightVertexSource<Mis>>;
    static constexpr bool kFilmWide = true;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p = plan_bdpt<Mis>(scene, settings);
        if (!p.rules.connect) return p;
        p.cache_draws = settings.connections;
        p.coherent_draws = settings.draws == CacheDraws::coherent;
        p.one_connection_per_launch |= p.cache_draws == 1;  // of one draw there is no second
        return p;
    }
    /// An eye vertex draws k of the M vertices of N subpaths, each of which has one of a given depth at most: k N / M
    /// samples of a strategy on average (docs/theory.md, equation 18).
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        if (!p.light_subpaths()) return 0.0;
        const double mean = mean_light_vertices<F>(scene, tracer, p.rules, seed);
        if (p.cache_draws > 0 && mean > 0.0) p.rules.mis.connections = float(p.cache_draws / mean);
        return mean;
    }
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        return Memory::template lay_out<kFusion, F>(layout, p, n);
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies(scene, p);
    }
    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        run_two_sides(exec, s);
    }
};
template <Features F, class Tracer, Fusion kFusion>
using LvcIntegrator = LvcOf<F, Tracer, kFusion, ModelFor<F, BidirectionalMis>>;

}  // namespace ambilux
