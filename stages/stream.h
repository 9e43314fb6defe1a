// Streaming bidirectional path tracing (van Antwerpen 2011, "Improving SIMD Efficiency for Parallel Monte Carlo Light Transport on the GPU"): of either walk only the last vertex is in
// memory, so that memory depends on the number of slots alone. An eye walk waits at each of its vertices while a light walk, made for this vertex, is connected with it vertex by vertex; then it
// goes on. A slot whose eye walk has ended starts the next path. The first light walk of a path also meets the camera (t = 1).
#pragma once

#include "stages/eye_walk.h"
#include "stages/light_walk.h"

namespace ambilux {

/// Marks the rays of light walks in WalkItem::path.
constexpr uint32_t kLightRay = 0x80000000u;

/// The slots, and what each of them keeps. Slot i does the paths i, i + slots, i + 2 slots ... of the wave, so that a path tells its slot.
struct StreamPool {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    uint32_t slots;
    Queue<ConnectionVertex> eye;      ///< by slot, not a queue: the vertex that the light walk is for; its path is kNoPath if it is for the camera only
    Queue<WalkItem> pending;    ///< by slot: the ray with which the eye walk goes on; depth 0: it has ended
    Queue<WalkItem> rays;
    Lane* samples;              ///< per path

    AMBILUX_HD uint32_t slot_of(uint32_t path) const { return path % slots; }
    AMBILUX_HD LightWalkNumber number_of(const ConnectionVertexFront& vertex) const { return {vertex.bits.depth() - 1}; }

    /// Starts the first of the paths `path`, path + slots ... that has a pixel.
    AMBILUX_HD void begin(uint32_t path) const {
        const uint32_t paths = wave.tiles * kTilePixels * wave.state->samples;
        for (; path < paths; path += slots) {
            samples[path] = {};
            const PathSlot p = wave.locate(path);
            if (!p.active || policy.max_depth == 0) continue;
            const CameraSample c = camera_sample(scene, wave, p);
            rays.push(pack_walk(start_eye_walk(scene, policy.mis, c), path, false, c.tmax));
            return;
        }
    }
    /// The light walk of `path` has ended.
    AMBILUX_HD void advance(uint32_t path) const {
        const WalkItem next = pending.load(slot_of(path));
        if (next.bits.depth() > 0)
            rays.push(next);
        else
            begin(path + slots);
    }
};

struct StreamBegin {
    StreamPool pool;

    AMBILUX_HD void operator()(uint32_t slot) const { pool.begin(slot); }
};

/// extend of eye rays and light rays together. Every ray becomes a hit, those that meet nothing too: their slots have to go on.
template <Features F, class Tracer>
struct StreamExtend {
    static constexpr Features kFeatures = F;
    static constexpr bool kAnyHit = false;

    SceneView scene;
    Tracer tracer;
    StreamPool pool;
    Queue<WalkHit> eye_hits, light_hits;
    StageRecord* record;

    AMBILUX_HD bool fetch(uint32_t i, Ray& ray) const {
        const WalkItem item = pool.rays.load(i);
        ray = ray_of(item);
        if constexpr (F.opacity) {
            const bool light = item.path & kLightRay;
            const uint32_t path = item.path & ~kLightRay, depth = item.bits.depth();
            ray.alpha_seed = light ? alpha_seed(pool.wave.key(path, Stream::light), pool.number_of(pool.eye.load_front(pool.slot_of(path))).alpha_depth(depth), false)
                                   : alpha_seed(pool.wave.key(path), depth, false);
        }
        if (is_finite(item.o) && is_finite(item.d)) return true;
        count_one(&record->nan);
        finish(i, {ray.tmax, 0.0f, 0.0f, kNone});
        return false;
    }

    AMBILUX_HD void finish(uint32_t i, const Hit& hit) const {
        WalkHit h = hit_of(pool.rays.load(i), hit);
        const bool light = h.ray.path & kLightRay;
        h.ray.path &= ~kLightRay;
        // Not one push to either of two queues: lanes that push together share a counter (take_place).
        if (light)
            light_hits.push(h);
        else
            eye_hits.push(h);
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        Ray ray;
        if (!fetch(i, ray)) return;
        Hit hit;
        tracer.template closest<F>(scene, ray, hit);
        finish(i, hit);
    }
};

/// A slot whose eye walk has come to a vertex or to its end.
struct TurnItem {
    uint32_t path;
    uint32_t light_walk;  ///< 1: a light walk is wanted before the eye walk goes on
    uint32_t pad[2];
};

template <Features F>
struct StreamEyeShade {
    StreamPool pool;
    Queue<WalkHit> hits;
    HitOutlet candidates;
    Queue<VertexItem> vertices;
    Queue<TurnItem> turns;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const WalkHit h = hits.load(i);
        const BidirectionalPolicy& policy = pool.policy;
        const uint32_t depth = h.ray.bits.depth(), slot = pool.slot_of(h.ray.path);
        ConnectionVertex vertex = {};
        vertex.front.bits = {depth};
        vertex.front.link = kNoPath;
        bool connect = false;
        WalkStep step = eye_step<F>(pool.scene, pool.wave, policy, h, candidates, record, [&](const WalkVertex& z, const RngKey&) {
            if (policy.next_event) push_vertex<F>(vertices, pack_vertex(z, h));
            connect = policy.connect_vertices && depth + 2 <= policy.max_depth;
            if (connect) vertex = pack_connection_vertex(z, h);
        });
        if (!step.goes_on) step.ray.bits = {0};
        pool.pending.store(slot, step.ray);
        pool.eye.store(slot, vertex, lanes_of<F>(vertex));
        turns.push({h.ray.path, connect || (policy.splat && depth == 1) ? 1u : 0u, {0, 0}});
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
        if (turn.light_walk && start_light<F>(pool.scene, pool.wave, pool.policy, turn.path, pool.number_of(pool.eye.load_front(pool.slot_of(turn.path))), splats, record, w))
            pool.rays.push(pack_walk(w, turn.path | kLightRay, true, kInfinity));
        else
            pool.advance(turn.path);
    }
};

/// light_shade: a light vertex, for the camera and for the eye vertex that waits.
template <Features F>
struct StreamLightShade {
    StreamPool pool;
    Queue<WalkHit> hits;
    Queue<VertexItem> camera_vertices;
    Queue<ConnectionVertex> pairs;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const WalkHit h = hits.load(i);
        const uint32_t path = h.ray.path;
        if (h.prim == kNone) return pool.advance(path);
        const BidirectionalPolicy& policy = pool.policy;
        const ConnectionVertexFront eye = pool.eye.load_front(pool.slot_of(path));
        const LightWalkNumber number = pool.number_of(eye);
        const uint32_t depth = h.ray.bits.depth();
        const bool splat = policy.splat && number.n == 0;
        // A path has one segment more than its light walk, and those of the eye walk if there is one.
        const uint32_t longest = splat ? policy.max_depth - 1 : policy.max_depth - 1 - eye.bits.depth();
        WalkStep step = light_step<F>(pool.scene, pool.wave, policy, h, number, longest, record, [&](const WalkVertex& y, const RngKey&) {
            if (splat && depth < policy.max_depth && policy.wants(depth + 1, 1)) push_vertex<F>(camera_vertices, pack_vertex(y, h));
            if (eye.link != kNoPath && depth + eye.bits.depth() + 1 <= policy.max_depth && may_connect(eye, y)) push_vertex<F>(pairs, pack_connection_vertex(y, h));
        });
        if (!step.goes_on) return pool.advance(path);
        step.ray.path |= kLightRay;
        pool.rays.push(step.ray);
    }
};

/// connect_vertices: a light vertex and the eye vertex that waits for it.
template <Features F>
struct StreamConnect {
    StreamPool pool;
    Queue<ConnectionVertex> pairs;
    ConnectOutlet candidates;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const ConnectionVertex light = load_vertex<F>(pairs, i);
        const EyeVertex eye = eye_vertex_of<F>(pool.scene, load_vertex<F>(pool.eye, pool.slot_of(light.path())));
        push_connection<F>(pool.scene, pool.policy, pool.wave.key(light.path()), eye, light, 1.0f, kNone, candidates, record);
    }
};

}  // namespace ambilux
