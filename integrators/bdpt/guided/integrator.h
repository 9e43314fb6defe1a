// bdpt, variant guided: eye subpaths of lvc sample directions from what was learned (integrators/shared/guide). Light
// subpaths follow the BSDF (docs/theory.md, "Guided bdpt").
#pragma once

#include "core/error.h"
#include "integrators/bdpt/lvc/integrator.h"
#include "integrators/shared/guide/guided.h"

namespace ambilux {

/// Starts light subpaths in one training round only, before the first iteration.
template <class Generate>
struct OfRound : Generate {
    const GuideProgress* progress;
    uint32_t training_round;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (progress->rounds == training_round) Generate::operator()(slot);
    }
};

template <Features F, class Tracer, Fusion kFusion>
struct LvcToGuide : LvcOf<F, Tracer, kFusion, GuidedMis<BidirectionalMis>> {
    using Mis = GuidedMis<BidirectionalMis>;
    using Lvc = LvcOf<F, Tracer, kFusion, Mis>;
    using Stages = typename Lvc::Stages;

    static typename Lvc::Policy plan(const Scene& scene, const RenderSettings& settings) {
        const typename Lvc::Policy p = Lvc::plan(scene, settings);
        const Sensor& film = scene.sensor;
        if (uint64_t(film.crop_width) * film.crop_height * p.waves.light_rounds() * (kGuideRounds + 1) > 0xffffffffull)
            throw Error(ExitCode::usage, "variant guided: the film has more light subpaths than can be numbered");
        return p;
    }

    /// Light that such paths bring to the film is of no use.
    struct Training : Stages {
        const GuideProgress* progress = nullptr;
        uint32_t round = 0;

        template <class Note>
        Training(const Stages& render, const Note& note) : Stages(render) {
            name_training(*this, note);
            this->light.generate.record = note("train_light_generate");
            this->light.generate.rules.splat = this->policy.rules.splat = false;
            for (auto& stage : this->light.extend) stage.record = note("train_light_extend");
            for (auto& stage : this->light.vertex) {
                stage.record = note("train_light_shade");
                stage.rules.splat = false;
            }
        }
        Training of_round(uint32_t of, const GuideProgress* at) const {
            Training t = *this;
            number_training(t, of);
            t.light.first_round = (of + 1) * t.policy.waves.light_rounds();
            t.progress = at;
            t.round = of;
            return t;
        }
    };
    template <bool kFused, class Executor, class Generate, class Before>
    static void wave(Executor& exec, const Stages& s, const Generate& generate, Before before) {
        if (s.policy.light_subpaths()) run_light_subpaths(exec, s.light, s.splats, s.policy);
        eye_subpaths<kFused>(exec, s, generate, before);
        if (s.policy.rules.splat) exec.run(s.splats.splat);
    }
    template <bool kFused, class Executor, class Generate, class Before>
    static void wave(Executor& exec, const Training& s, const Generate& generate, Before before) {
        if (s.policy.light_subpaths())
            run_light_subpaths(exec, s.light, s.splats, s.policy, NothingBefore(), [&s](const auto& start) {
                return OfRound<std::decay_t<decltype(start)>>{start, s.progress, s.round};
            });
        eye_subpaths<kFused>(exec, s, generate, before);
    }

private:
    template <bool kFused, class Executor, class Generate, class Before>
    static void eye_subpaths(Executor& exec, const Stages& s, const Generate& generate, Before before) {
        run_eye_subpaths<kFused>(exec, s, generate, before);
        if (s.policy.rules.connect) exec.clear(s.source.vertices);
    }
};
template <Features F, class Tracer, Fusion kFusion>
using BdptGuidedIntegrator = GuidedOf<F, Tracer, kFusion, LvcToGuide<F, Tracer, kFusion>>;

}  // namespace ambilux
