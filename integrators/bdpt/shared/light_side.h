// Light subpaths, and what becomes of the light that they bring to the film.
#pragma once

#include "integrators/bdpt/shared/policy.h"
#include "integrators/shared/subpath_queues.h"
#include "stages/arrival.h"
#include "stages/extend.h"
#include "stages/eye_vertex.h"
#include "stages/generate.h"
#include "stages/light_vertex.h"
#include "stages/splat.h"

namespace ambilux {

/// Queues of splats. Those that arrived are kept until the end of the wave; their number is not known before, and a
/// wave for which there is no room is done again with more.
template <class Mis>
struct SplatQueues {
    Queue<VertexItem<Mis>> vertices;  ///< of one depth, for a stage that connects them with the camera
    Queue<CandidateItem> candidates, weighted;
    Queue<SplatItem> splats;

    SplatQueues() = default;
    /// `slots`: items of a depth; `kept`: splats of the wave.
    template <Fusion K, Features F>
    [[gnu::cold]] static SplatQueues lay_out(Layout& layout, uint32_t slots, uint64_t kept,
                                             const BdptPolicyOf<Mis>& p) {
        const bool by_path = p.waves.queues.fixed_places();
        const uint32_t n = p.rules.splat ? slots : 0;
        SplatQueues q;
        q.vertices = layout.queue<VertexItem<Mis>>("camera_vertices", K.connect ? 0 : n, by_path,
                                                   VertexItem<Mis>::template lanes<F>());
        q.candidates = layout.queue<CandidateItem>("splat_candidates", K.weigh ? 0 : n, by_path);
        q.weighted = layout.queue<CandidateItem>("weighted_splats", n, by_path && !K.occlude);
        q.splats = layout.growing_queue<SplatItem>("splats",
                                                   p.rules.splat ? uint32_t(std::min<uint64_t>(kept, 0xfffffff0u)) : 0);
        return q;
    }
};

/// The stages behind the vertices of light subpaths.
template <Features F, class Tracer, Fusion K, class Mis>
struct SplatSide {
    using OccludeStage = OccludeSplats<F, Tracer>;
    using Weighted = std::conditional_t<K.occlude, Gathered<OccludeStage>, Queue<CandidateItem>>;
    using WeighStage = WeighSplats<Weighted>;
    using Candidates = std::conditional_t<K.weigh, WeighStage, Queue<CandidateItem>>;
    using Connect = ConnectCamera<F, Mis, Candidates>;
    using ConnectHere = std::conditional_t<K.occlude, Clocked<Connect>, Connect>;
    using AtVertex = std::conditional_t<K.connect, ConnectHere, QueueVertex<F, Mis>>;

    OccludeStage occlude;
    WeighStage weigh;
    ConnectCameraQueue<F, Mis, Candidates> connect_camera;
    Splat<F> splat;

    [[gnu::cold]] SplatSide(const WaveParts<Tracer>& parts, const SplatQueues<Mis>& q, const BdptPolicyOf<Mis>& p,
                            Lane* raw) {
        const auto& [layout, scene, tracer, wave, film] = parts;
        occlude = {scene, tracer, q.weighted, {q.splats}, layout.record(OccludeStage::kName)};
        weigh = {q.candidates,
                 choose<K.occlude>(Gathered<OccludeStage>{occlude, wave.state, q.weighted.capacity()}, q.weighted),
                 layout.record(WeighStage::kName)};
        StageRecord* const connects = layout.record(connect_camera.kName);
        connect_camera = {scene, wave, p.rules, q.vertices, {candidates(), connects}, connects};
        const StrategyFilm strategies = {film.strategies, film.strategies_dropped, raw, p.waves.strategy_depth};
        splat = {scene, wave, q.splats, film.splats, strategies, layout.record(Splat<F>::kName)};
    }

    Candidates candidates() const { return choose<K.weigh>(weigh, weigh.candidates); }
    AtVertex at_vertex() const {
        return choose<K.connect>(ConnectHere{connect_camera.connect}, QueueVertex<F, Mis>{connect_camera.vertices});
    }
};

/// Splat candidates of one depth: weighted, tested, kept for the end of the wave.
template <class Executor, Features F, class Tracer, Fusion K, class Mis>
void run_splats(Executor& exec, const SplatSide<F, Tracer, K, Mis>& splats) {
    if constexpr (!K.weigh) exec.run(splats.weigh);
    if constexpr (K.occlude)
        exec.trace_gathered(splats.occlude);
    else
        exec.trace(splats.occlude);
}

/// Light subpaths of a wave whose vertices are kept for its eye subpaths.
template <Features F, class Tracer, Fusion K, class Mis>
struct LightStages {
    using Splats = SplatSide<F, Tracer, K, Mis>;

    GenerateLight<F, Mis, typename Splats::Candidates> generate;
    Extend<F, Tracer, Mis> extend[2];
    LightVertex<F, Mis, typename Splats::AtVertex> vertex[2];
    ConnectCameraQueue<F, Mis, typename Splats::Candidates> connect_camera;

    [[gnu::cold]] LightStages(const WaveParts<Tracer>& parts, const SubpathQueues<SubpathRay<Mis>>& q,
                              LightVertices<Mis> vertices, uint32_t* last_vertex, const Splats& splats,
                              const BdptPolicyOf<Mis>& p)
        : connect_camera(splats.connect_camera) {
        const auto& [layout, scene, tracer, wave, film] = parts;
        const auto record = [&records = layout](const auto& stage) { return records.record(stage.kName); };
        generate = {scene,
                    wave,
                    p.rules,
                    q.rays[0],
                    splats.candidates(),
                    last_vertex,
                    record(generate),
                    p.waves.light_subpaths_per_tile};
        for (int k = 0; k < 2; ++k) {
            extend[k] = {scene, tracer, wave, Stream::light, q.rays[k], q.hits[k], layout.record(extend[k].kLightName)};
            vertex[k] = {scene,
                         wave,
                         p.rules,
                         q.hits[k],
                         q.rays[1 - k],
                         vertices,
                         last_vertex,
                         splats.at_vertex(),
                         record(vertex[k])};
        }
    }

    /// The same stages for the first subpaths of all slots, the second ..., which differ by their random numbers.
    LightStages in_round(uint32_t round) const {
        LightStages s = *this;
        s.generate.round = round;
        const uint32_t first_key = round * generate.wave.width * generate.wave.height;
        s.generate.wave.first_key = s.connect_camera.wave.first_key = first_key;
        for (int k = 0; k < 2; ++k) s.extend[k].wave.first_key = s.vertex[k].wave.first_key = first_key;
        return s;
    }
};

/// `before(k, vertex)`: what else is done with the hits in place k, before stage `vertex`.
template <class Executor, Features F, class Tracer, Fusion K, class Mis, class Before = NothingBefore>
void run_light_subpaths(Executor& exec, const LightStages<F, Tracer, K, Mis>& all,
                        const SplatSide<F, Tracer, K, Mis>& splats, const BdptPolicyOf<Mis>& p, Before before = {}) {
    for (uint32_t round = 0; round < p.waves.light_rounds(); ++round) {
        const auto s = all.in_round(round);
        exec.run_slots(s.generate, s.generate.wave.tiles * kTilePixels);
        if (p.rules.splat) run_splats(exec, splats);
        exec.set_depth(1);
        exec.extend(s.extend[0]);
        const auto rest = [&](bool) {
            if (!p.rules.splat) return;
            if constexpr (!K.connect) exec.run(s.connect_camera);
            run_splats(exec, splats);
        };
        repeat_depths(exec, s.vertex, s.extend, p.waves.multi_bounce_below, rest, before);
        exec.set_depth(0);
    }
    exec.fail_on_overflow(all.vertex[0].vertices, splats.splat.splats);
}

}  // namespace ambilux
