// The memory of a wave of paired light and eye walks and the stages that work on it.
#pragma once

#include "integrators/walk_queues.h"
#include "queues/layout.h"
#include "render/renderer.h"
#include "stages/accumulate.h"
#include "stages/extend.h"
#include "stages/eye_walk.h"
#include "stages/light_walk.h"
#include "stages/megakernel.h"
#include "stages/mis_weight.h"
#include "stages/occlude.h"
#include "stages/splat.h"
#include "stages/stream.h"

namespace ambilux {

/// What `settings` ask of a scene (integrators light and bdpt). Throws Error(usage) when walks might never end or
/// nothing is left to do.
BidirectionalPolicy make_bidirectional_policy(const Scene& scene, const RenderSettings& settings);

/// Names of strategies and kernel parts that this render does without.
std::vector<std::string> skipped_strategies(const Scene& scene, const BidirectionalPolicy& policy,
                                            const Features& kernels);

/// Memory of one wave. Most queues hold the most they can ever be given, since a slot has one item at a time. Of shadow
/// rays it may have several, as many as there is room for (ConnectVertices::room). Vertices of light walks and what
/// they splat are kept until the end of the wave; their number is not known before, and a wave for which they do not
/// suffice is done again with more (settle()).
struct BidirectionalMemory : WalkQueues<WalkItem, WalkHit> {
    static constexpr uint32_t kQueues = 21;

    WaveState* state;
    StageRecord* records;                  ///< one per StageId
    QueueCounter* counters;                ///< one per queue
    Queue<VertexItem> vertices;            ///< of one depth, for stages that connect them with emitters or the camera
    Queue<ConnectionVertex> eye_vertices;  ///< of one depth, for pairs
    LightVertices light_vertices;
    Queue<SplatCandidate> splat_candidates, weighted_splats;
    Queue<SplatItem> splats;
    Queue<PairItem> pairs, rest;
    Queue<HitCandidate> hit_candidates;
    Queue<Contribution> hit_contributions;
    Queue<ConnectCandidate> connect_candidates;
    Queue<ShadowItem> shadows;
    Queue<Contribution> shadow_contributions;
    uint32_t* last_vertex;
    Lane* raw;  ///< TechniqueFilm::raw
    // Variant streaming.
    Queue<SlotHit> eye_hits, light_hits;
    Queue<TurnItem> turns;
    Queue<ConnectionVertex> eye, waiting;
    Queue<VertexItem> camera_vertices;
    Queue<WalkItem> pending;
};

/// Memory of the megakernel, whose walks live in registers. Other queues are empty.
inline BidirectionalMemory lay_out_megakernel(Layout& layout, uint32_t slots, uint32_t kept,
                                              const BidirectionalPolicy& policy) {
    BidirectionalMemory m{};
    m.state = layout.take<WaveState>(1);
    m.records = layout.take<StageRecord>(kStageCount);
    m.counters = layout.take<QueueCounter>(BidirectionalMemory::kQueues);
    m.light_vertices = layout.queue<ConnectionVertex>("light_vertices", m.counters, policy.connect_vertices ? kept : 0,
                                                      false, policy.connection_lanes);
    m.splats = layout.queue<SplatItem>("splats", m.counters, policy.splat ? kept + slots : 0);
    return m;
}

/// Memory of the variant streaming: nothing but the film's samples depends on the number of paths or their length.
inline BidirectionalMemory lay_out_streaming(Layout& layout, uint32_t paths, const BidirectionalPolicy& policy) {
    const uint32_t slots = policy.stream_slots;
    const auto when = [&](bool needed) { return needed ? slots : 0u; };
    const bool connections = policy.next_event || policy.connect_vertices, staged = !policy.fuse,
               hits = staged && (policy.count_hits || policy.count_environment);
    BidirectionalMemory m{};
    m.state = layout.take<WaveState>(1);
    m.records = layout.take<StageRecord>(kStageCount);
    m.counters = layout.take<QueueCounter>(BidirectionalMemory::kQueues);
    m.rays[0] = layout.queue<WalkItem>("rays", m.counters, slots, true);
    m.eye_hits = layout.queue<SlotHit>("eye_hits", m.counters, slots);
    m.light_hits = layout.queue<SlotHit>("light_hits", m.counters, when(policy.light_walks));
    m.turns = layout.queue<TurnItem>("turns", m.counters, slots);
    m.eye = layout.queue<ConnectionVertex>("eye_vertices", m.counters, slots, false, policy.connection_lanes);
    m.pending = layout.queue<WalkItem>("pending", m.counters, slots);
    m.vertices = layout.queue<VertexItem>("vertices", m.counters, when(policy.next_event), false, policy.vertex_lanes);
    m.camera_vertices =
        layout.queue<VertexItem>("camera_vertices", m.counters, when(policy.splat), false, policy.vertex_lanes);
    m.waiting = layout.queue<ConnectionVertex>("pairs", m.counters, when(policy.connect_vertices), false,
                                               policy.connection_lanes);
    m.splat_candidates = layout.queue<SplatCandidate>("splat_candidates", m.counters, when(policy.splat && staged));
    m.weighted_splats = layout.queue<SplatCandidate>("weighted_splats", m.counters, when(policy.splat));
    m.splats = layout.queue<SplatItem>("splats", m.counters, with_holes(when(policy.splat)));
    m.hit_candidates = layout.queue<HitCandidate>("hit_candidates", m.counters, when(hits));
    m.hit_contributions = layout.queue<Contribution>("hit_contributions", m.counters, when(hits));
    m.connect_candidates =
        layout.queue<ConnectCandidate>("connect_candidates", m.counters, when(connections && staged));
    m.shadows = layout.queue<ShadowItem>("shadows", m.counters, when(connections));
    m.shadow_contributions =
        layout.queue<Contribution>("shadow_contributions", m.counters, when(connections && staged));
    m.raw = layout.take<Lane>(policy.technique_depth ? paths : 0);
    return m;
}

/// The most items that a stage goes through in order (OrderMemory::slots).
inline uint32_t order_slots(const BidirectionalPolicy& policy, uint32_t slots) {
    return policy.stream_slots ? policy.stream_slots : slots;
}

/// Lays out the memory for `slots` paths and `kept` vertices of their light walks.
inline BidirectionalMemory lay_out(Layout& layout, uint32_t slots, uint32_t kept, const BidirectionalPolicy& policy) {
    const auto when = [&](bool needed, uint32_t n = 0) { return needed ? (n ? n : slots) : 0u; };
    // The megakernel keeps vertices and splats only.
    if (policy.megakernel) return lay_out_megakernel(layout, slots, kept, policy);
    if (policy.stream_slots) return lay_out_streaming(layout, slots, policy);
    const bool fixed = policy.queues.fixed_places();
    const bool connections = policy.next_event || policy.connect_vertices, staged = !policy.fuse,
               hits = staged && (policy.count_hits || policy.count_environment);
    const bool gathered = !policy.at_once;
    const uint32_t pairs = when(policy.connect_vertices && gathered), shadows = when(connections && gathered);
    BidirectionalMemory m{};
    m.state = layout.take<WaveState>(1);
    m.records = layout.take<StageRecord>(kStageCount);
    m.counters = layout.take<QueueCounter>(BidirectionalMemory::kQueues);
    lay_out_walks(layout, m, m.counters, slots, policy.queues);
    m.vertices =
        layout.queue<VertexItem>("vertices", m.counters, when(!policy.connect_in_shade), fixed, policy.vertex_lanes);
    m.eye_vertices = layout.queue<ConnectionVertex>(
        "eye_vertices", m.counters, when(policy.connect_vertices && gathered), false, policy.connection_lanes);
    m.light_vertices = layout.queue<ConnectionVertex>("light_vertices", m.counters, when(policy.connect_vertices, kept),
                                                      false, policy.connection_lanes);
    m.splat_candidates =
        layout.queue<SplatCandidate>("splat_candidates", m.counters, when(policy.splat && staged), fixed);
    m.weighted_splats =
        layout.queue<SplatCandidate>("weighted_splats", m.counters, when(policy.splat && gathered), fixed);
    m.splats = layout.queue<SplatItem>(
        "splats", m.counters,
        when(policy.splat, uint32_t(std::min<uint64_t>(kept + policy.most_light_walks(slots), 0xfffffff0u))));
    m.pairs = layout.queue<PairItem>("pairs", m.counters, pairs, fixed);
    m.rest = layout.queue<PairItem>("rest", m.counters, policy.trace_pairs ? 0 : pairs, fixed);
    m.hit_candidates = layout.queue<HitCandidate>("hit_candidates", m.counters, when(hits), fixed);
    m.hit_contributions = layout.queue<Contribution>("hit_contributions", m.counters, when(hits), fixed);
    m.connect_candidates =
        layout.queue<ConnectCandidate>("connect_candidates", m.counters, staged ? shadows : 0, fixed);
    m.shadows = layout.queue<ShadowItem>("shadows", m.counters, shadows, fixed);
    m.shadow_contributions =
        layout.queue<Contribution>("shadow_contributions", m.counters, staged ? shadows : 0, fixed);
    m.last_vertex = layout.take<uint32_t>(slots);
    m.raw = layout.take<Lane>(policy.technique_depth ? slots : 0);
    return m;
}

/// Buffers of the film. `samples`: by slot of this wave.
struct BidirectionalFilm {
    Lane* samples;
    SplatSums splats;
    double *sum, *sum_squares;
    int64_t* techniques = nullptr;  ///< TechniqueFilm::sums
    uint64_t* technique_dropped = nullptr;
};

/// Values of TechniqueFilm::sums for a film of `pixels`.
inline uint64_t technique_values(const BidirectionalPolicy& policy, uint64_t pixels) {
    return uint64_t(technique_count(policy.technique_depth)) * 2 * pixels * 3;
}

/// Means of what `sums` gathered.
std::vector<TechniqueImage> technique_images(uint32_t max_depth, uint64_t samples, const std::vector<int64_t>& sums,
                                             const std::vector<uint64_t>& dropped);

/// The stages of light walks.
template <Features F, class Tracer>
struct LightStages {
    LightGenerate<F> generate;
    Extend<F, Tracer, WalkItem, WalkHit> extend[2];
    LightShade<F> shade[2];
    ConnectCamera<F> connect_camera;
};

/// The stages over one wave, ready to launch.
template <Features F, class Tracer>
struct BidirectionalStages {
    BidirectionalPolicy policy;
    Wave wave;
    BidirectionalMemory memory;
    LightStages<F, Tracer> light_walks;
    WeightSplats weight_splats;
    OccludeSplats<F, Tracer> occlude_splats;
    Splat splat;
    EyeGenerate generate;
    Extend<F, Tracer, WalkItem, WalkHit> extend[2];
    EyeShade<F> shade[2];
    WeightHits weight_hits;
    Accumulate accumulate_hits;
    EyeConnect<F> connect;
    ConnectVertices<F> connect_vertices, connect_rest;
    ConnectAndOcclude<F, Tracer> connect_and_occlude, connect_and_occlude_several;
    Megakernel<F, Tracer> megakernel;
    StreamBegin stream_begin;
    StreamExtend<F, Tracer> stream_extend;
    StreamEyeShade<F> stream_eye_shade;
    StreamTurn<F> stream_turn;
    StreamLightShade<F> stream_light_shade;
    StreamConnect<F> stream_connect;
    ConnectCamera<F> stream_connect_camera;
    WeightConnections weight_connections;
    // With one item of a path in a launch, and with several.
    Occlude<F, Tracer> occlude, occlude_several;
    Accumulate accumulate_shadows, accumulate_several;
    DevelopSplats develop;

    BidirectionalStages(const SceneView& scene, const Tracer& tracer, const BidirectionalPolicy& p, Wave w,
                        const BidirectionalMemory& m, const BidirectionalFilm& film)
        : policy(p), wave(w), memory(m) {
        wave.state = m.state;
        const auto record = [&](StageId id) { return m.records + uint32_t(id); };
        // Weights are 1/(1 + others): the balance of 1 and `others`, in which the heuristic is applied already.
        PathPolicy sums{};
        sums.estimator = Estimator::mis;
        sums.heuristic = MisHeuristic::balance;
        sums.cull = p.cull;
        const TechniqueFilm techniques = {film.techniques, m.raw, film.technique_dropped, policy.technique_depth};
        accumulate_hits = {m.hit_contributions, film.samples, record(StageId::accumulate), wave, techniques};
        weight_hits = {sums,
                       m.hit_candidates,
                       {m.hit_contributions, accumulate_hits, policy.fuse},
                       record(StageId::mis_weight),
                       techniques};
        accumulate_shadows = {m.shadow_contributions, film.samples, record(StageId::accumulate), wave, techniques};
        weight_connections = {sums,       m.connect_candidates, {m.shadows}, record(StageId::mis_weight),
                              techniques, film.samples};
        weight_splats = {m.splat_candidates, {m.weighted_splats}, record(StageId::mis_weight)};
        if (policy.at_once) {
            weight_connections.shadows.stage = weight_splats.weighted.stage = this;
            weight_connections.shadows.take = [](const void* self, const ShadowItem& item) {
                static_cast<const BidirectionalStages*>(self)->take_at_once(&BidirectionalStages::occlude, item);
            };
            weight_splats.weighted.take = [](const void* self, const SplatCandidate& item) {
                static_cast<const BidirectionalStages*>(self)->take_at_once(&BidirectionalStages::occlude_splats, item);
            };
        }
        const HitOutlet hit_outlet = {m.hit_candidates, weight_hits, policy.fuse};
        const ConnectOutlet connect_outlet = {m.connect_candidates, weight_connections, policy.fuse};
        const SplatOutlet splat_outlet = {m.splat_candidates, weight_splats, policy.fuse};
        light_walks.connect_camera = {scene, wave, policy, m.vertices, splat_outlet, record(StageId::connect_camera)};
        connect = {scene,
                   wave,
                   policy,
                   m.vertices,
                   m.eye_vertices,
                   m.light_vertices,
                   m.last_vertex,
                   m.pairs,
                   connect_outlet,
                   record(StageId::connect),
                   record(StageId::connect_vertices)};
        for (int k = 0; k < 2; ++k) {
            light_walks.extend[k] = {
                scene, tracer, wave, Stream::light, m.rays[k], m.hits[k], record(StageId::light_extend)};
            light_walks.shade[k] = {scene,
                                    wave,
                                    policy,
                                    m.hits[k],
                                    m.rays[1 - k],
                                    m.light_vertices,
                                    m.vertices,
                                    m.last_vertex,
                                    record(StageId::light_shade),
                                    light_walks.connect_camera};
            extend[k] = {scene, tracer, wave, Stream::eye, m.rays[k], m.hits[k], record(StageId::extend)};
            shade[k] = {scene,  wave, policy, m.hits[k], m.rays[1 - k], hit_outlet, m.vertices, record(StageId::shade),
                        connect};
        }
        light_walks.generate = {
            scene, wave, policy, m.rays[0], splat_outlet, m.last_vertex, record(StageId::light_generate)};
        occlude_splats = {scene, tracer, m.weighted_splats, m.splats, record(StageId::occlude)};
        splat = {scene, wave, m.splats, film.splats, techniques, record(StageId::splat)};
        generate = {scene, wave, policy, m.rays[0], film.samples, record(StageId::generate)};
        connect_vertices = {scene,
                            wave,
                            policy,
                            m.pairs,
                            m.rest,
                            m.eye_vertices,
                            m.light_vertices,
                            connect_outlet,
                            record(StageId::connect_vertices)};
        connect_rest = {scene,
                        wave,
                        policy,
                        m.rest,
                        m.pairs,
                        m.eye_vertices,
                        m.light_vertices,
                        connect_outlet,
                        record(StageId::connect_vertices)};
        megakernel = {scene, tracer, wave, policy, m.light_vertices, m.splats, film.samples, m.records};
        const StreamPool pool = {scene, wave, policy, m.rays[0], m.eye, m.pending, film.samples, &m.state->next_path};
        stream_begin = {pool};
        stream_extend = {scene, tracer, pool, m.eye_hits, m.light_hits, record(StageId::extend)};
        stream_eye_shade = {pool, m.eye_hits, hit_outlet, m.vertices, m.turns, record(StageId::shade)};
        stream_turn = {pool, m.turns, splat_outlet, record(StageId::light_generate)};
        stream_light_shade = {pool, m.light_hits, m.camera_vertices, m.waiting, record(StageId::light_shade)};
        stream_connect_camera = {scene, wave, policy, m.camera_vertices, splat_outlet, record(StageId::connect_camera)};
        stream_connect = {pool, m.waiting, connect_outlet, record(StageId::connect_vertices)};
        occlude = {scene,
                   tracer,
                   m.shadows,
                   {m.shadow_contributions, accumulate_shadows, policy.fuse},
                   record(StageId::occlude)};
        occlude_several = occlude;
        accumulate_several = accumulate_shadows;
        accumulate_several.shared = true;
        occlude_several.contributions.next = accumulate_several;
        connect_and_occlude = {connect_vertices, occlude};
        connect_and_occlude_several = {connect_vertices, occlude_several};
        develop = {wave, film.samples, film.splats, film.sum, film.sum_squares, record(StageId::develop)};
    }
    BidirectionalStages(const BidirectionalStages&) = delete;  // some stages point to others

    /// The stages of light walks in one round: the first of all slots, the second ...
    LightStages<F, Tracer> light(uint32_t round) const {
        LightStages<F, Tracer> l = light_walks;
        l.generate.round = round;
        const uint32_t first_key = round * wave.width * wave.height;
        l.generate.wave.first_key = l.connect_camera.wave.first_key = first_key;
        for (int k = 0; k < 2; ++k) l.extend[k].wave.first_key = l.shade[k].wave.first_key = first_key;
        return l;
    }

private:
    template <class Stage, class Item>
    void take_at_once(Stage BidirectionalStages::* stage, const Item& item) const {
        (this->*stage).record->count_item(memory.state->depth);
        (this->*stage).take(item);
    }
};

}  // namespace ambilux
