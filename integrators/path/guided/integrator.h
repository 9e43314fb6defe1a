// path, variant guided: the path tracer samples directions from what it has learned (integrators/shared/guide).
#pragma once

#include "integrators/path/integrator.h"
#include "integrators/shared/guide/guided.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct PathToGuide : PathIntegrator<F, Tracer, kFusion, NextEvent, NoSettings, GuidedMis<UnidirectionalMis>> {
    using Path = PathIntegrator<F, Tracer, kFusion, NextEvent, NoSettings, GuidedMis<UnidirectionalMis>>;

    struct Training : Path::Stages {
        template <class Note>
        Training(const typename Path::Stages& render, const Note& note) : Path::Stages(render) {
            name_training(*this, note);
        }
    };
    template <bool kFused, class Executor, class Generate, class Before>
    static void wave(Executor& exec, const typename Path::Stages& s, const Generate& generate, Before before) {
        Path::template eye_subpaths<kFused>(exec, s, generate, before);
    }
};
template <Features F, class Tracer, Fusion kFusion>
using PathGuidedIntegrator = GuidedOf<F, Tracer, kFusion, PathToGuide<F, Tracer, kFusion>>;

}  // namespace ambilux
