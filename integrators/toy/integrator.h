// toy: ambient occlusion, the smallest integrator with all that one has: settings, policy, memory, stages, a schedule.
#pragma once

#include "integrators/shared/eye_side.h"
#include "integrators/shared/subpath_queues.h"
#include "integrators/toy/ambient.h"
#include "stages/extend.h"
#include "stages/generate.h"

namespace ambilux {

template <Features F, class Tracer, Fusion kFusion>
struct ToyIntegrator {
    using Mis = UnidirectionalMis;
    static constexpr bool kFilmWide = false;

    /// What it does where, decided once by the host.
    struct Policy {
        Rules<Mis> rules;
        WavePolicy waves;
        ToySettings toy;
    };
    static Policy plan(const Scene&, const RenderSettings& settings) {
        Policy p{};
        p.rules.next_event = true;  // rooms for shadow rays, one a path
        p.waves.queues = settings.queues;
        p.waves.deterministic = settings.deterministic;
        p.toy = ToySettings::plan(settings);
        return p;
    }
    static std::vector<std::string> skipped(const Scene&, const Policy&) { return {}; }

    using State = NoState;  // nothing outlives a wave

    /// The queues of a wave.
    struct Memory {
        SubpathQueues<PathRay> subpaths;
        EyeQueues<Mis> eye;
    };
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        Memory m;
        m.subpaths = {layout, n.slots, p.waves.queues};
        m.eye = EyeQueues<Mis>::template lay_out<kFusion, F>(layout, n.slots, n.slots, p.rules, p.waves);
        return m;
    }

    /// What works on them.
    struct Stages {
        using Eye = EyeSide<F, Tracer, kFusion>;

        Wave wave;
        Eye eye;
        GenerateEye<F, Mis> generate;
        Extend<F, Tracer, Mis> extend;
        Ambient<F, typename Eye::Candidates> ambient;

        Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State&)
            : wave(parts.wave), eye(parts, m.eye, p.waves) {
            const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
            const SceneView& scene = parts.scene;
            const SubpathQueues<PathRay>& q = m.subpaths;
            generate = {scene, wave, p.rules.mis, q.rays[0], parts.film.samples, record(generate)};
            extend = {scene, parts.tracer, wave, Stream::eye, q.rays[0], q.hits[0], record(extend)};
            ambient = {scene, wave, p.toy, q.hits[0], eye.candidates(), record(ambient)};
        }
    };

    /// One wave.
    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        start_eye_subpaths<kFusion.generate>(exec, s.generate, s.extend, s.wave.tiles * kTilePixels);
        exec.run(s.ambient);
        run_candidates(exec, s.eye, false);
        exec.set_depth(0);
    }
};

}  // namespace ambilux
