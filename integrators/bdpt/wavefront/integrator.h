// bdpt, variant wavefront: every eye subpath is connected with the light subpath of its slot.
#pragma once

#include "integrators/bdpt/shared/two_sides.h"
#include "transport/mis/by_sobol.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion, class Mis>
struct WavefrontOf {
    using Policy = BdptPolicyOf<Mis>;
    using State = NoState;
    using Memory = TwoSidesMemory<Mis>;
    using Stages = TwoSidesStages<F, Tracer, kFusion, LightVertexSource<Mis>>;
    static constexpr bool kFilmWide = true;

    /// Throws Error(usage) for numbers of light subpaths that leave an eye subpath without its own.
    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        const Policy p = plan_bdpt<Mis>(scene, settings);
        if (p.rules.connect)
            need_one_light_subpath(settings,
                                   "variant wavefront connects every eye subpath with a light subpath of its own; use "
                                   "variant lvc, or strategies without connections");
        return p;
    }
    static double pilot(Policy& p, const SceneView& scene, const HostTracer& tracer, uint64_t seed) {
        return p.light_subpaths() ? mean_light_vertices<F>(scene, tracer, p.rules, seed) : 0.0;
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
using WavefrontIntegrator = WavefrontOf<F, Tracer, kFusion, ModelFor<F, BidirectionalMis>>;

/// Integrator light has the stages of its one group of strategies (plan_bdpt).
template <Features F, class Tracer, Fusion kFusion>
using LightIntegrator = WavefrontIntegrator<F, Tracer, kFusion>;

}  // namespace ambilux
