// bdpt, variant streaming: one ray per slot in every round, of its eye subpath or of a light subpath for the eye vertex
// at which that waits. Memory does not depend on the length of paths.
#pragma once

#include "integrators/bdpt/shared/light_side.h"
#include "integrators/shared/eye_side.h"
#include "stages/streaming.h"

namespace ambilux {

/// Only what weighs and adds up is fused: rounds gather the vertices of all slots.
constexpr Fusion streaming_fusion(Fusion wanted) { return {wanted.weigh, false, false, false}; }

template <Features F, class Tracer, Fusion kWanted, class Mis>
struct StreamingOf {
    using Policy = BdptPolicyOf<Mis>;
    using Vertex = ConnectionVertex<Mis>;
    static constexpr Fusion kFusion = streaming_fusion(kWanted);
    static constexpr bool kFilmWide = true;

    static Policy plan(const Scene& scene, const RenderSettings& settings) {
        Policy p = plan_bdpt<Mis>(scene, settings);
        need_one_light_subpath(settings, "variant streaming has one light subpath per eye vertex; use variant lvc");
        p.waves.keeps_light_vertices = false;
        p.waves.slots_in_flight = 1;  // the renderer says how many
        p.waves.most_paths = kLightRay - 1;
        return p;
    }
    static double pilot(Policy&, const SceneView&, const HostTracer&, uint64_t) { return 0.0; }
    static std::vector<std::string> skipped(const Scene& scene, const Policy& p) {
        return skipped_strategies(scene, p);
    }

    using State = NoState;
    struct Memory {
        Queue<SubpathRay<Mis>> rays;
        Queue<SlotHit> eye_hits, light_hits;
        Queue<TurnItem> turns;
        LaneArray<Vertex> eye_vertices;
        LaneArray<SubpathRay<Mis>> pending;
        Queue<Vertex> pairs;
        EyeQueues<Mis> eye;
        SplatQueues<Mis> splats;
        uint32_t* next_path;
    };
    static Memory lay_out(Layout& layout, const Policy& p, WaveSize n) {
        const uint32_t slots = p.waves.slots_in_flight, lanes = Vertex::template lanes<F>();
        Memory m;
        m.rays = layout.queue<SubpathRay<Mis>>("rays", slots, true);
        m.eye_hits = layout.queue<SlotHit>("eye_hits", slots);
        m.light_hits = layout.queue<SlotHit>("light_hits", p.light_subpaths() ? slots : 0);
        m.turns = layout.queue<TurnItem>("turns", slots);
        m.eye_vertices = layout.array<Vertex>(slots, lanes);
        m.pending = layout.array<SubpathRay<Mis>>(slots);
        m.pairs = layout.queue<Vertex>("pairs", p.rules.connect ? slots : 0, false, lanes);
        m.eye = EyeQueues<Mis>::template lay_out<kFusion, F>(layout, slots, n.slots, p.rules, p.waves);
        m.splats = SplatQueues<Mis>::template lay_out<kFusion, F>(layout, slots, with_holes(slots), p);
        m.next_path = layout.allocate<uint32_t>(1);
        return m;
    }

    struct Stages {
        using Eye = EyeSide<F, Tracer, kFusion>;
        using Splats = SplatSide<F, Tracer, kFusion, Mis>;
        using Connect = NextEvent<F, Mis, typename Eye::Candidates>;

        Policy policy;
        Wave wave;
        Eye eye;
        Splats splats;
        StreamBegin<F, Mis> begin;
        StreamExtend<F, Tracer, Mis> extend;
        StreamEyeVertex<F, Mis, typename Eye::Emission> eye_vertex;
        StreamTurn<F, Mis, typename Splats::Candidates> turn;
        StreamLightVertex<F, Mis> light_vertex;
        ConnectEmitter<F, Mis, Connect> connect_emitter;
        StreamConnect<F, Mis, typename Eye::Candidates> connect_vertices;

        [[gnu::cold]] Stages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const State&)
            : policy(p), wave(parts.wave), eye(parts, m.eye, p.waves), splats(parts, m.splats, p, m.eye.raw) {
            const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
            const SceneView& scene = parts.scene;
            const bool seeds = F.opacity || p.waves.cull > 0.0f;
            const StreamPool<F, Mis> pool = {
                scene, wave, p.rules, m.rays, m.eye_vertices, m.pending, parts.film.samples, m.next_path};
            begin = {pool, record(begin)};
            extend = {scene, parts.tracer, pool, m.eye_hits, m.light_hits, record(extend)};
            eye_vertex = {pool, m.eye_hits, eye.emission(), m.eye.vertices, m.turns, record(eye_vertex)};
            turn = {pool, m.turns, splats.candidates(), record(turn)};
            light_vertex = {pool, m.light_hits, m.splats.vertices, m.pairs, record(light_vertex)};
            connect_emitter = {scene,
                               wave,
                               p.rules,
                               m.eye.vertices,
                               {eye.candidates(), record(connect_emitter), seeds},
                               record(connect_emitter)};
            connect_vertices = {pool, m.pairs, {}, eye.candidates(), record(connect_vertices), seeds};
        }
    };

    template <class Executor>
    static void schedule(Executor& exec, const Stages& s) {
        const Rules<Mis>& rules = s.policy.rules;
        if (rules.max_depth == 0) return;
        exec.store(s.begin.pool.next_path, s.policy.waves.slots_in_flight);
        exec.run_slots(s.begin, s.policy.waves.slots_in_flight, 1);
        exec.repeat_while(s.extend.items(), [&] {
            exec.trace(s.extend);
            exec.run(s.eye_vertex);
            if (s.policy.light_subpaths()) exec.run(s.light_vertex);
            exec.run(s.turn);
            run_emission(exec, s.eye);
            if (rules.next_event) {
                exec.run(s.connect_emitter);
                run_candidates(exec, s.eye, false);
            }
            if (rules.connect) {
                exec.run(s.connect_vertices);
                run_candidates(exec, s.eye, false);
            }
            if (!rules.splat) return;
            exec.run(s.splats.connect_camera);
            run_splats(exec, s.splats);
            exec.run(s.splats.splat);
        });
    }
};
template <Features F, class Tracer, Fusion kWanted>
using StreamingIntegrator = StreamingOf<F, Tracer, kWanted, BidirectionalMis>;

}  // namespace ambilux
