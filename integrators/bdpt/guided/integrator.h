// bdpt, variant guided: subpaths of lvc sample directions from what was learned (integrators/shared/guide;
// docs/theory.md, "Guided bdpt").
#pragma once

#include "integrators/bdpt/lvc/integrator.h"
#include "integrators/shared/guide/guided.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct LvcToGuide : LvcOf<F, Tracer, kFusion, GuidedMis<BidirectionalMis>> {
    using Mis = GuidedMis<BidirectionalMis>;
    using Stages = typename LvcOf<F, Tracer, kFusion, Mis>::Stages;

    /// Paths of strategies without light subpaths, weighted as if there were no others: training learns where light
    /// comes from, and iterations what of it is left to the eye side.
    struct Training : Stages {
        template <class Note>
        Training(const Stages& render, const Note& note) : Stages(render) {
            name_training(*this, note);
            const auto alone = [](auto& rules) {
                rules.splat = rules.connect = false;
                rules.mis.strategies &= kHitStrategies | kNextEventStrategies;
            };
            alone(this->policy.rules);
            alone(this->connect_emitter.rules);
            for (auto& stage : this->eye_vertex) alone(stage.rules);
            this->generate.mis = this->policy.rules.mis;
        }
    };
    template <bool kFused, class Executor, class Generate, class Before>
    static void wave(Executor& exec, const Stages& s, const Generate& generate, Before before) {
        if (s.policy.light_subpaths()) run_light_subpaths(exec, s.light, s.splats, s.policy);
        run_eye_subpaths<kFused>(exec, s, generate, before);
        if (s.policy.rules.splat) exec.run(s.splats.splat);
        if (s.policy.rules.connect) exec.clear(s.source.vertices);
    }
};
template <Features F, class Tracer, Fusion kFusion>
using BdptGuidedIntegrator = GuidedOf<F, Tracer, kFusion, LvcToGuide<F, Tracer, kFusion>>;

}  // namespace ambilux
