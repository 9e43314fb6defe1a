// path: the unidirectional path tracer. Hits of emitters, next event estimation, or both with weights.
#pragma once

#include "integrators/path/policy.h"
#include "integrators/shared/eye_side.h"
#include "integrators/shared/subpath_queues.h"
#include "stages/extend.h"
#include "stages/eye_vertex.h"
#include "stages/generate.h"
#include "transport/mis/by_sobol.h"

namespace ambilux {

/// Of a Sampling that is told nothing.
struct NoSettings {
    static NoSettings plan(const RenderSettings&) { return {}; }
};

/// `Sampling`: how eye vertices sample emitters, with `SamplingSettings` as its last member unless that is empty.
/// `Learn`: see Occlude; SamplingSettings::learn() makes it.
template <Features F, class Tracer, Fusion kFusion, template <Features, class, class> class Sampling = NextEvent,
          class SamplingSettings = NoSettings, class Model = ModelFor<F, UnidirectionalMis>, class Learn = LearnNothing>
struct PathIntegrator {
    using Mis = Model;
    using RayItem = typename SubpathItems<Mis>::Ray;
    template <class Out>
    using SampleEmitters = Sampling<F, Mis, Out>;
    static constexpr bool kFilmWide = false;

    struct Policy {
        Rules<Mis> rules;
        WavePolicy waves;
        SamplingSettings sampling;
    };
    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        const PathPolicy p = plan_path(scene, settings);
        Mis mis = {p.rules.mis};
        if constexpr (requires { mis.sobol; }) mis.sobol = settings.sampler == Sampler::sobol;
        return {p.rules.with(mis), p.waves, SamplingSettings::plan(settings)};
    }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& policy) {
        return skipped_path_parts(scene, policy.rules.with(UnidirectionalMis(policy.rules.mis)));
    }

    using State = NoState;
    struct Memory {
        SubpathQueues<RayItem> subpaths;
        EyeQueues<Mis, Learn> eye;
    };
    /// Every queue holds the most it can ever be given: a slot has at most one item of each kind at a time.
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        Memory m;
        m.subpaths = {layout, n.slots, p.waves.queues};
        m.eye = EyeQueues<Mis, Learn>::template lay_out<kFusion, F>(layout, n.slots, n.slots, p.rules, p.waves);
        return m;
    }

    struct Stages {
        using Eye = EyeSide<F, Tracer, kFusion, Learn>;
        using Connect = Sampling<F, Mis, typename Eye::Candidates>;
        using ConnectHere = std::conditional_t<kFusion.occlude, Clocked<Connect>, Connect>;
        using AtVertex = std::conditional_t<kFusion.connect, ConnectHere, QueueVertex<F, Mis>>;

        Policy policy;
        Wave wave;
        Eye eye;
        GenerateEye<F, Mis> generate;
        Extend<F, Tracer, Mis> extend[2];
        EyeVertex<F, Mis, typename Eye::Emission, AtVertex> eye_vertex[2];
        ConnectEmitter<F, Mis, Connect> connect_emitter;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State&)
            : policy(p), wave(parts.wave), eye(parts, m.eye, p.waves, learn_of(p)) {
            const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
            const SceneView& scene = parts.scene;
            const SubpathQueues<RayItem>& q = m.subpaths;
            const bool seeds = F.opacity || p.waves.cull > 0.0f;
            const Connect connect = sampling(record(connect_emitter), seeds);
            generate = {scene, wave, p.rules.mis, q.rays[0], parts.film.samples, record(generate)};
            connect_emitter = {scene, wave, p.rules, m.eye.vertices, connect, connect.record};
            const auto at_vertex = choose<kFusion.connect>(ConnectHere{connect}, QueueVertex<F, Mis>{m.eye.vertices});
            for (int k = 0; k < 2; ++k) {
                extend[k] = {scene, parts.tracer, wave, Stream::eye, q.rays[k], q.hits[k], record(extend[k])};
                eye_vertex[k] = {scene,
                                 wave,
                                 p.rules,
                                 q.hits[k],
                                 q.rays[1 - k],
                                 eye.emission(),
                                 at_vertex,
                                 record(eye_vertex[k]),
                                 kFusion.generate && !q.hits[0].flags};
            }
        }

        static Learn learn_of(const Policy& p) {
            if constexpr (std::is_same_v<Learn, LearnNothing>)
                return {};
            else
                return p.sampling.learn();
        }
        Connect sampling(StageRecord* record, bool seeds) const {
            if constexpr (std::is_empty_v<SamplingSettings>)
                return {eye.candidates(), record, seeds};
            else
                return {eye.candidates(), record, seeds, policy.sampling};
        }
    };

    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        if (s.policy.rules.max_depth > 0) eye_subpaths<kFusion.generate>(exec, s, s.generate);
    }
    /// From camera rays by `generate` on; `before`: repeat_depths.
    template <bool kFused, class Executor, class Generate, class Before = NothingBefore>
    static void eye_subpaths(Executor& exec, const Stages& s, const Generate& generate, Before before = {}) {
        start_eye_subpaths<kFused>(exec, generate, s.extend[0], s.wave.tiles * kTilePixels);
        const auto rest = [&](bool several_bounces) {
            run_emission(exec, s.eye);
            if (!s.policy.rules.next_event) return;
            if constexpr (!kFusion.connect) exec.run(s.connect_emitter);
            run_candidates(exec, s.eye, several_bounces);
        };
        repeat_depths(exec, s.eye_vertex, s.extend, s.policy.waves.multi_bounce_below, rest, before);
        exec.set_depth(0);
    }
};

}  // namespace ambilux
