// Light subpaths of a wave first, then the eye subpaths of the same slots, whose vertices are connected with the light
// vertices that were kept. The variants wavefront and lvc differ by which light vertices these are.
#pragma once

#include "integrators/bdpt/shared/light_side.h"
#include "integrators/bdpt/shared/pilot.h"
#include "integrators/shared/eye_side.h"
#include "stages/connect_vertices.h"

namespace ambilux {

/// Memory of one wave. Most queues hold the most they can ever be given, since a slot has one item at a time. Of shadow
/// rays it may have several, as many as there is capacity for.
/// `Learn`: see Occlude.
template <class Mis, class Learn = LearnNothing>
struct TwoSidesMemory {
    using Vertex = ConnectionVertex<Mis>;

    SubpathQueues<SubpathRay<Mis>> subpaths;
    EyeQueues<Mis, Learn> eye;
    SplatQueues<Mis> splats;
    Queue<Vertex> eye_vertices;  ///< of one depth, for pairs
    LightVertices<Mis> light_vertices;
    Queue<PairItem> pairs, deferred;
    uint32_t* last_vertex;

    template <Fusion K, Features F>
    [[gnu::cold]] static TwoSidesMemory lay_out(Layout& layout, const BdptPolicyOf<Mis>& p, WaveSize n) {
        const bool by_path = p.waves.queues.fixed_places();
        const uint32_t lanes = Vertex::template lanes<F>(), pairs = p.rules.connect && !K.occlude ? n.slots : 0;
        TwoSidesMemory m;
        m.subpaths = {layout, n.slots, p.waves.queues};
        m.eye = EyeQueues<Mis, Learn>::template lay_out<K, F>(layout, n.slots, n.slots, p.rules, p.waves);
        m.splats =
            SplatQueues<Mis>::template lay_out<K, F>(layout, n.slots, n.kept + p.waves.most_light_subpaths(n.slots), p);
        m.eye_vertices = layout.queue<Vertex>("eye_vertices", pairs, false, lanes);
        m.light_vertices = layout.growing_queue<Vertex>("light_vertices", p.wave_keeps_vertices() ? n.kept : 0, lanes);
        m.pairs = layout.queue<PairItem>("pairs", pairs, by_path);
        m.deferred = layout.queue<PairItem>("deferred", p.traces_connections ? 0 : pairs, by_path);
        m.last_vertex = p.cache_draws == 0 ? layout.allocate<uint32_t>(n.slots) : nullptr;
        return m;
    }
};

/// `Source`: where light vertices come from (stages/light_vertex_search.h).
template <Features F, class Tracer, Fusion K, class Source>
struct TwoSidesStages {
    using Mis = typename Source::Mis;
    using Policy = BdptPolicyOf<Mis>;
    using Memory = TwoSidesMemory<Mis, typename Source::Learn>;
    using Eye = EyeSide<F, Tracer, K, typename Source::Learn>;
    using Splats = SplatSide<F, Tracer, K, Mis>;
    using Candidates = typename Eye::Candidates;
    using Connect = std::conditional_t<K.occlude, NextEventAndConnections<F, Candidates, Source>,
                                       NextEventAndPair<F, Candidates, Source>>;
    using AtVertex = std::conditional_t<K.connect, Connect, QueueVertex<F, Mis>>;
    /// A device may trace connections in place, in kernels for diffuse surfaces.
    static constexpr bool kTracesConnections =
        K.weigh && !K.occlude && F.bsdfs == bit(BsdfType::diffuse) && std::is_same_v<Source, LightVertexSource<Mis>>;

    Policy policy;
    Wave wave;
    Eye eye;
    Splats splats;
    LightStages<F, Tracer, K, Mis> light;
    Source source;
    GenerateEye<F, Mis> generate;
    Extend<F, Tracer, Mis> extend[2];
    EyeVertex<F, Mis, typename Eye::Emission, AtVertex> eye_vertex[2];
    ConnectEmitter<F, Mis, Connect> connect_emitter;
    ConnectVertices<F, Candidates, Source> connect_vertices, connect_deferred;

    TwoSidesStages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const NoState&)
        : TwoSidesStages(parts, p, m, Source{m.light_vertices, m.last_vertex, p.cache_draws, p.coherent_draws}) {}
    [[gnu::cold]] TwoSidesStages(const WaveParts<Tracer>& parts, const Policy& p, const Memory& m, const Source& from)
        : policy(p), wave(parts.wave), eye(parts, m.eye, p.waves, from.learn()), splats(parts, m.splats, p, m.eye.raw),
          light(parts, m.subpaths, m.light_vertices, m.last_vertex, splats, p.of_light_side()), source(from) {
        const auto record = [&](const auto& stage) { return parts.layout.record(stage.kName); };
        const SceneView& scene = parts.scene;
        const bool seeds = F.opacity || p.waves.cull > 0.0f;
        const NextEvent<F, Mis, Candidates> next_event = {eye.candidates(), record(connect_emitter), seeds};
        Connect connect;
        if constexpr (K.occlude)
            connect = {{next_event}, source, wave.state, record(connect_vertices)};
        else
            connect = {next_event, source, m.eye_vertices, m.pairs};
        const SubpathQueues<SubpathRay<Mis>>& q = m.subpaths;
        generate = {scene, wave, p.rules.mis, q.rays[0], parts.film.samples, record(generate)};
        connect_emitter = {scene, wave, p.rules, m.eye.vertices, connect, next_event.record};
        const auto at_vertex = choose<K.connect>(connect, QueueVertex<F, Mis>{m.eye.vertices});
        for (int k = 0; k < 2; ++k) {
            extend[k] = {scene, parts.tracer, wave, Stream::eye, q.rays[k], q.hits[k], record(extend[k])};
            eye_vertex[k] = {scene,         wave,           p.rules,   q.hits[k],
                             q.rays[1 - k], eye.emission(), at_vertex, record(eye_vertex[k]),
                             false};
        }
        connect_vertices = {scene,
                            wave,
                            p.rules,
                            m.pairs,
                            m.deferred,
                            m.eye_vertices,
                            source,
                            eye.candidates(),
                            eye.candidate_capacity(),
                            eye.candidate_counter(),
                            record(connect_vertices),
                            seeds,
                            p.one_connection_per_launch};
        connect_deferred = connect_vertices;
        std::swap(connect_deferred.pairs, connect_deferred.deferred);
    }

    /// connect_vertices with its shadow rays.
    auto connect_and_occlude(bool needs_atomic_add) const
        requires kTracesConnections
    {
        return ConnectAndOcclude<F, Tracer, typename Eye::Shadows, Source>{
            connect_vertices, eye.occlude.with_atomic_add(needs_atomic_add), connect_vertices.record};
    }
};

/// The pairs of one depth: connected, weighted, tested, added to their paths.
template <class Executor, Features F, class Tracer, Fusion K, class Source>
void run_connections(Executor& exec, const TwoSidesStages<F, Tracer, K, Source>& s, bool several_bounces) {
    if constexpr (s.kTracesConnections && !Executor::kHost)
        if (s.policy.traces_connections) return exec.run(s.connect_and_occlude(several_bounces));
    const bool needs_atomic_add = several_bounces || !s.policy.one_connection_per_launch;
    exec.run(s.connect_vertices);
    run_candidates(exec, s.eye, needs_atomic_add);
    const uint32_t longest = s.policy.cache_draws > 0 ? s.policy.cache_draws : s.policy.rules.max_depth - 2;
    if (longest <= 1) return;
    exec.repeat_while(s.connect_vertices.deferred, [&] {
        exec.run(s.connect_deferred);
        run_candidates(exec, s.eye, needs_atomic_add);
        exec.run(s.connect_vertices);
        run_candidates(exec, s.eye, needs_atomic_add);
    });
}

/// From camera rays by `generate` on, in all slots at once if `kFused` (start_eye_subpaths). `before(k, vertex)`: what
/// else is done with the hits in place k, before stage `vertex`.
template <bool kFused, class Executor, Features F, class Tracer, Fusion K, class Source, class Generate, class Before>
void run_eye_subpaths(Executor& exec, const TwoSidesStages<F, Tracer, K, Source>& s, const Generate& generate,
                      Before before) {
    const auto& rules = s.policy.rules;
    start_eye_subpaths<kFused>(exec, generate, s.extend[0], s.wave.tiles * kTilePixels);
    const auto rest = [&](bool several_bounces) {
        run_emission(exec, s.eye);
        if constexpr (!K.connect) exec.run(s.connect_emitter);
        if (rules.next_event || K.occlude) run_candidates(exec, s.eye, several_bounces);
        if constexpr (!K.occlude) {
            if (!rules.connect) return;
            run_connections(exec, s, several_bounces);
            exec.clear(s.connect_vertices.vertices);
        }
    };
    repeat_depths(exec, s.eye_vertex, s.extend, s.policy.waves.multi_bounce_below, rest, before);
    exec.set_depth(0);
}
template <class Executor, Features F, class Tracer, Fusion K, class Source, class Before = NothingBefore>
void run_eye_subpaths(Executor& exec, const TwoSidesStages<F, Tracer, K, Source>& s, Before before = {}) {
    run_eye_subpaths<K.generate>(exec, s, s.generate, before);
}

/// One wave.
template <class Executor, Features F, class Tracer, Fusion K, class Source>
void run_two_sides(Executor& exec, const TwoSidesStages<F, Tracer, K, Source>& s) {
    if (s.policy.rules.max_depth == 0) return;
    if (s.policy.light_subpaths()) run_light_subpaths(exec, s.light, s.splats, s.policy);
    run_eye_subpaths(exec, s);
    if (s.policy.rules.splat) exec.run(s.splats.splat);
    if (s.policy.rules.connect) exec.clear(s.source.vertices);
}

}  // namespace ambilux
