// Streaming bidirectional path tracing (van Antwerpen 2011, "Improving SIMD Efficiency for Parallel Monte Carlo Light
// Transport on the GPU"): of either walk only the last vertex is in memory, so that memory depends on the number of
// slots alone. An eye walk waits at each of its vertices while a light walk, made for this vertex, is connected with it
// vertex by vertex; then it goes on. A slot whose eye walk has ended starts the next path. The first light walk of a
// path also meets the camera (t = 1).
#pragma once

#include "stages/eye_walk.h"
#include "stages/light_walk.h"

namespace ambilux {

/// Marks the rays of light walks in WalkItem::path.
constexpr uint32_t kLightRay = 0x80000000u;

/// The slots, and what each of them keeps. A slot goes on with whichever path is next when it is done with one, so that
/// all are at work until there are no more.
struct StreamPool {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkItem> rays;  ///< by slot, as the next two: of its eye walk or of the light walk for it
    Queue<ConnectionVertex>
        eye;  ///< the vertex that the light walk is for; its path is kNoPath if it is for the camera only
    Queue<WalkItem> pending;  ///< the ray with which the eye walk goes on; depth 0: it has ended
    Lane* samples;            ///< per path
    uint32_t* next_path;      ///< WaveState::next_path

    AMBILUX_HD LightWalkNumber number_of(const ConnectionVertexFront& vertex) const {
        return {vertex.bits.depth() - 1};
    }
    /// The hit of a slot's ray, and whose it is.
    AMBILUX_HD WalkHit hit_of(const SlotHit& end) const {
        WalkHit h = {rays.load(end.slot), end.u, end.v, end.prim, 0};
        h.ray.path &= ~kLightRay;
        return h;
    }

    /// Starts `path`, or the next that has a pixel.
    AMBILUX_HD void begin(uint32_t slot, uint32_t path) const {
        const uint32_t paths = wave.tiles * kTilePixels * wave.state->samples;
        for (; path < paths; path = take_place(next_path)) {
            samples[path] = {};
            const PathSlot p = wave.locate(path);
            if (!p.active || policy.max_depth == 0) continue;
            const CameraSample c = camera_sample(scene, wave, p);
            rays.put(slot, pack_walk(start_eye_walk(scene, policy.mis, c), path, false, c.tmax));
            return;
        }
    }
    /// The light walk of a slot has ended.
    AMBILUX_HD void advance(uint32_t slot) const {
        const WalkItem next = pending.load(slot);
        if (next.bits.depth() > 0)
            rays.put(slot, next);
        else
            begin(slot, take_place(next_path));
    }
};

struct StreamBegin {
    StreamPool pool;

    AMBILUX_HD void operator()(uint32_t slot) const { pool.begin(slot, slot); }
};

/// extend of eye rays and light rays together. Every ray has a hit, those that meet nothing too: their slots have to go
/// on.
template <Features F, class Tracer>
struct StreamExtend {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;

    SceneView scene;
    Tracer tracer;
    StreamPool pool;
    Queue<SlotHit> eye_hits, light_hits;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t slot, Ray& ray) const {
        const WalkItem item = pool.rays.load(slot);
        ray = ray_of(item);
        if constexpr (F.opacity) {
            const bool light = item.path & kLightRay;
            const uint32_t path = item.path & ~kLightRay, depth = item.bits.depth();
            ray.alpha_seed = light ? alpha_seed(pool.wave.key(path, Stream::light),
                                                pool.number_of(pool.eye.load_front(slot)).alpha_depth(depth), false)
                                   : alpha_seed(pool.wave.key(path), depth, false);
        }
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        finish(slot, {ray.tmax, 0.0f, 0.0f, kNone});
        return false;
    }

    AMBILUX_HD void finish(uint32_t slot, const Hit& hit) const {
        // Not one push to either of two queues: lanes that push together share a counter (take_place).
        if (pool.rays.load(slot).path & kLightRay)
            light_hits.push({hit.u, hit.v, hit.prim, slot});
        else
            eye_hits.push({hit.u, hit.v, hit.prim, slot});
    }

    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (!fetch(slot, ray)) return;
        Hit hit;
        tracer.template closest<F>(scene, ray, hit);
        finish(slot, hit);
    }
};

/// A slot whose eye walk has come to a vertex or to its end.
struct TurnItem {
    uint32_t path;
    uint32_t slot;
    uint32_t light_walk;  ///< 1: a light walk is wanted before the eye walk goes on
    uint32_t pad;
};

template <Features F>
struct StreamEyeShade {
    static constexpr uint32_t kBlocksPerSm = EyeShade<F>::kBlocksPerSm;

    StreamPool pool;
    Queue<SlotHit> hits;
    HitOutlet candidates;
    Queue<VertexItem> vertices;
    Queue<TurnItem> turns;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const SlotHit end = hits.load(i);
        const WalkHit h = pool.hit_of(end);
        const BidirectionalPolicy& policy = pool.policy;
        const uint32_t depth = h.ray.bits.depth();
        ConnectionVertex vertex = {};
        vertex.front.bits = {depth};
        vertex.front.link = kNoPath;
        bool connect = false;
        WalkStep step =
            eye_step<F>(pool.scene, pool.wave, policy, h, candidates, record, [&](const WalkVertex& z, const RngKey&) {
                if (policy.next_event) push_vertex<F>(vertices, pack_vertex(z, h));
                connect = policy.connect_vertices && depth + 2 <= policy.max_depth;
                if (connect) vertex = pack_connection_vertex(z, h);
            });
        if (!step.goes_on) step.ray.bits = {0};
        pool.pending.store(end.slot, step.ray);
        pool.eye.store(end.slot, vertex, lanes_of<F>(vertex));
        turns.push({h.ray.path, end.slot, connect || (policy.splat && depth == 1) ? 1u : 0u, 0});
    }
};

/// light_generate: starts the light walk for an eye vertex, or lets the eye walk go on at once.
template <Features F>
struct StreamTurn {
    StreamPool pool;
    Queue<TurnItem> turns;
    SplatOutlet splats;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const TurnItem turn = turns.load(i);
        Walk w;
        if (turn.light_walk && start_light<F>(pool.scene, pool.wave, pool.policy, turn.path,
                                              pool.number_of(pool.eye.load_front(turn.slot)), splats, record, w))
            pool.rays.put(turn.slot, pack_walk(w, turn.path | kLightRay, true, kInfinity));
        else
            pool.advance(turn.slot);
    }
};

/// light_shade: a light vertex, for the camera and for the eye vertex that waits.
template <Features F>
struct StreamLightShade {
    static constexpr uint32_t kBlocksPerSm = LightShade<F>::kBlocksPerSm;

    StreamPool pool;
    Queue<SlotHit> hits;
    Queue<VertexItem> camera_vertices;
    Queue<ConnectionVertex> pairs;  ///< light vertices, whose `link` is the slot of the eye vertex
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const SlotHit end = hits.load(i);
        if (end.prim == kNone) return pool.advance(end.slot);
        const WalkHit h = pool.hit_of(end);
        const BidirectionalPolicy& policy = pool.policy;
        const ConnectionVertexFront eye = pool.eye.load_front(end.slot);
        const LightWalkNumber number = pool.number_of(eye);
        const uint32_t depth = h.ray.bits.depth();
        const bool splat = policy.splat && number.n == 0;
        // A path has one segment more than its light walk, and those of the eye walk if there is one.
        const uint32_t longest = splat ? policy.max_depth - 1 : policy.max_depth - 1 - eye.bits.depth();
        WalkStep step = light_step<F>(
            pool.scene, pool.wave, policy, h, number, longest, record, [&](const WalkVertex& y, const RngKey&) {
                if (splat && depth < policy.max_depth && policy.wants(depth + 1, 1))
                    push_vertex<F>(camera_vertices, pack_vertex(y, h));
                if (eye.link != kNoPath && depth + eye.bits.depth() + 1 <= policy.max_depth && may_connect(eye, y))
                    push_vertex<F>(pairs, pack_connection_vertex(y, depth, h.ray.d, h.ray.throughput, end.slot));
            });
        if (!step.goes_on) return pool.advance(end.slot);
        step.ray.path |= kLightRay;
        pool.rays.put(end.slot, step.ray);
    }
};

/// connect_vertices: a light vertex and the eye vertex that waits for it.
template <Features F>
struct StreamConnect {
    static constexpr uint32_t kBlocksPerSm = ConnectVertices<F>::kBlocksPerSm;

    StreamPool pool;
    Queue<ConnectionVertex> pairs;
    ConnectOutlet candidates;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const ConnectionVertex light = load_vertex<F>(pairs, i);
        const EyeVertex eye = eye_vertex_of<F>(pool.scene, load_vertex<F>(pool.eye, light.front.link));
        push_connection<F>(pool.scene, pool.policy, pool.wave.key(eye.path), eye, light, 1.0f, kNone, candidates,
                           record);
    }
};

}  // namespace ambilux
