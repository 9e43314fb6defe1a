// The memory of a wave of eye walks and the stages that work on it.
#pragma once

#include <algorithm>

#include "integrators/walk_queues.h"
#include "queues/layout.h"
#include "render/renderer.h"
#include "stages/accumulate.h"
#include "stages/connect.h"
#include "stages/extend.h"
#include "stages/generate.h"
#include "stages/mis_weight.h"
#include "stages/occlude.h"
#include "stages/shade.h"

namespace ambilux {

/// What `settings` ask of a scene. Throws Error(usage) when walks might never end.
PathPolicy make_path_policy(const Scene& scene, const RenderSettings& settings);

/// Which tiles and samples fit into a wave of about `wave_size` paths. Throws Error(usage) if slots would not fit 32
/// bits.
Wave shape_wave(const Scene& scene, const RenderSettings& settings, uint32_t wave_size, uint32_t max_tiles);

/// Paths of a wave on a device where `settings` leave it open: `plateau`, from which on more do not pay, or as many as
/// the render has, or as fit into half of the `free` bytes beside what other programs hold.
inline uint32_t device_wave_size(const Scene& scene, const RenderSettings& settings, uint32_t plateau,
                                 uint64_t bytes_per_path, uint64_t free) {
    if (settings.wave_size > 0) return settings.wave_size;
    const auto tiles = [](uint32_t pixels) { return uint64_t(pixels + kTileSide - 1) / kTileSide; };
    const uint64_t slots = tiles(scene.sensor.crop_width) * tiles(scene.sensor.crop_height) * kTilePixels;
    const bool fewer = settings.expected_samples > 0 && settings.expected_samples <= plateau / slots;
    return uint32_t(std::clamp<uint64_t>(free / 2 / bytes_per_path, kTilePixels,
                                         fewer ? slots * settings.expected_samples : plateau));
}

/// PathPolicy::tail_below, for waves of `slots`. Walks of a tail may bring several contributions in one launch: their
/// sums depend on the order of threads, and queues have room for that many only where items are appended. Stages that
/// pass light on without queues do not need that room.
inline uint32_t tail_walks(const RenderSettings& settings, uint32_t slots) {
    const bool suits = !settings.deterministic && settings.technique_depth == 0 && settings.fuse != Fuse::none &&
                       !settings.queues.fixed_places() && settings.accel != "bvh2";
    return settings.tail && suits ? std::min(kTailWalks, slots / kTailDepths) : 0;
}

/// Tiles of the whole film.
uint32_t tile_count(const Wave& wave);

/// Names of stages and kernel parts that this render does without.
std::vector<std::string> skipped_parts(const Scene& scene, const PathPolicy& policy, const Features& kernels);

/// Memory of one wave. Every queue holds the most it can ever be given: a slot has at most one ray, hit, connection and
/// contribution at a time.
struct PathMemory : WalkQueues<RayItem, HitItem> {
    static constexpr uint32_t kQueues = 8;

    WaveState* state;
    StageRecord* records;    ///< one per StageId
    QueueCounter* counters;  ///< one per queue
    Queue<HitCandidate> hit_candidates;
    Queue<Contribution> hit_contributions;
    Queue<ConnectItem> connections;
    Queue<ConnectCandidate> connect_candidates;
    Queue<ShadowItem> shadows;
    Queue<Contribution> shadow_contributions;
    Lane* samples;
};

/// Lays out the memory for `slots` paths; queues that `policy` leaves empty have no storage.
inline PathMemory lay_out(Layout& layout, uint32_t slots, const PathPolicy& policy) {
    const uint32_t hits = policy.count_hits && !policy.fuse ? slots : 0, connections = policy.connect ? slots : 0,
                   passed_on = policy.fuse ? 0 : connections;
    const bool fixed = policy.queues.fixed_places();
    PathMemory m;
    m.state = layout.take<WaveState>(1);
    m.records = layout.take<StageRecord>(kStageCount);
    m.counters = layout.take<QueueCounter>(PathMemory::kQueues);
    lay_out_walks(layout, m, m.counters, slots, policy.queues);
    m.hit_candidates = layout.queue<HitCandidate>("hit_candidates", m.counters, hits, fixed);
    m.hit_contributions = layout.queue<Contribution>("hit_contributions", m.counters, hits, fixed);
    m.connections =
        layout.queue<ConnectItem>("connections", m.counters, policy.connect_in_shade ? 0 : connections, fixed);
    m.connect_candidates = layout.queue<ConnectCandidate>("connect_candidates", m.counters, passed_on, fixed);
    m.shadows = layout.queue<ShadowItem>("shadows", m.counters, connections, fixed);
    m.shadow_contributions = layout.queue<Contribution>("shadow_contributions", m.counters, passed_on, fixed);
    m.samples = layout.take<Lane>(slots);
    return m;
}

/// Where the sums of the film lie.
struct FilmPointers {
    double *sum, *sum_squares;
};

/// The stages of a path tracer over one wave, ready to launch.
template <Features F, class Tracer>
struct PathStages {
    PathPolicy policy;
    Wave wave;
    PathMemory memory;
    Generate generate;
    Extend<F, Tracer> extend[2];
    WeightHits weight_hits;
    Accumulate accumulate_hits;
    Connect<F> connect;
    Shade<F> shade[2];
    WeightConnections weight_connections;
    Occlude<F, Tracer> occlude, occlude_tail;
    Accumulate accumulate_shadows;
    Develop develop;

    PathStages(const SceneView& scene, const Tracer& tracer, const PathPolicy& p, Wave w, const PathMemory& m,
               FilmPointers film)
        : policy(p), wave(w), memory(m) {
        wave.state = m.state;
        const auto record = [&](StageId id) { return m.records + uint32_t(id); };
        generate = {scene, wave, policy, m.rays[0], m.samples, record(StageId::generate)};
        accumulate_hits = {m.hit_contributions, m.samples, record(StageId::accumulate)};
        weight_hits = {
            policy, m.hit_candidates, {m.hit_contributions, accumulate_hits, policy.fuse}, record(StageId::mis_weight)};
        weight_connections = {policy, m.connect_candidates, {m.shadows}, record(StageId::mis_weight), {}, m.samples};
        connect = {scene,
                   wave,
                   policy,
                   m.connections,
                   {m.connect_candidates, weight_connections, policy.fuse},
                   record(StageId::connect)};
        for (int k = 0; k < 2; ++k) {
            extend[k] = {scene, tracer, wave, Stream::eye, m.rays[k], m.hits[k], record(StageId::extend)};
            shade[k] = {scene,
                        wave,
                        policy,
                        m.hits[k],
                        {m.hit_candidates, weight_hits, policy.fuse},
                        m.connections,
                        m.rays[1 - k],
                        record(StageId::shade),
                        connect};
        }
        accumulate_shadows = {m.shadow_contributions, m.samples, record(StageId::accumulate)};
        occlude = {scene,
                   tracer,
                   m.shadows,
                   {m.shadow_contributions, accumulate_shadows, policy.fuse},
                   record(StageId::occlude)};
        occlude_tail = occlude;
        occlude_tail.contributions.next.shared = true;
        develop = {wave, m.samples, film.sum, film.sum_squares, record(StageId::develop)};
    }
};

}  // namespace ambilux
