// generate, shade and connect of bidirectional path tracing: walks that start at the camera.
#pragma once

#include "stages/connect_vertices.h"
#include "stages/generate.h"

namespace ambilux {

struct EyeGenerate {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkItem> rays;
    Lane* samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        WalkItem ray;
        if (make(slot, ray)) rays.push(ray);
    }
    /// False if the slot has none.
    AMBILUX_HD bool make(uint32_t slot, WalkItem& ray) const {
        samples[slot] = {};
        const PathSlot p = wave.locate(slot);
        if (!p.active || policy.max_depth == 0) return false;
        const CameraSample c = camera_sample(scene, wave, p);
        ray = pack_walk(start_eye_walk(scene, policy.mis, c), slot, false, c.tmax);
        return true;
    }
};

/// An eye walk at `h`: emission becomes a candidate, and visit(vertex, random numbers of the walk) is called where
/// connections may start.
template <Features F, class Visit>
AMBILUX_HD WalkStep eye_step(const SceneView& scene, const Wave& wave, const BidirectionalPolicy& policy,
                             const WalkHit& h, const HitOutlet& candidates, StageRecord* record, Visit visit) {
    const auto emit = [&](Rgb radiance, float others) {
        const Strategy strategy = Strategy::make(0, h.ray.bits.depth() + 1);
        if (!policy.singles.has(strategy)) return;
        const Rgb value = h.ray.throughput * radiance;
        if (is_light(value, record) && !is_zero(value))
            candidates.push({value, h.ray.path, 1.0f, policy.others(others), strategy, 0});
    };
    WalkStep step = {};
    Walk w = unpack_walk(h.ray);
    const bool visible = !(policy.hide_emitters && w.depth == 1);
    if (h.prim == kNone) {
        if constexpr (F.has_environment())
            if (policy.counts_environment(w.depth) && visible)
                emit(environment_radiance<F>(scene, w.d), others_of_escape<F>(scene, policy.mis, w.sums, w.depth, w.d));
        return step;
    }
    if (policy.background_only) return step;
    const WalkVertex z = eye_vertex<F>(scene, policy.mis, w, h.prim, h.u, h.v);
    const uint32_t emitter = scene.shapes[z.point.shape].emitter;
    if (policy.count_hits && visible && emitter != kNone) {
        const Rgb radiance = emitted_radiance<F>(scene, emitter, z.point, -w.d);
        if (!is_zero(radiance))
            emit(radiance,
                 others_of_hit<F>(scene, policy.mis, w.sums, w.depth, emitter, w.o, w.d, w.start_distance, z.point));
    }
    if (w.depth >= policy.max_depth) return step;
    const RngKey key = wave.key(h.ray.path);
    if ((policy.next_event || policy.connect_vertices) && bsdf_is_smooth(z.scattering.bsdf)) {
        visit(z, key);
    }
    const uint32_t depth = w.depth;
    if (depth + 1 == policy.max_depth && !policy.counts_last_segment()) return step;
    const Vec4f u = random_floats(key, scatter_block(depth));
    if (!scatter_walk<F>(policy.mis, z, u, TransportMode::radiance, policy.rr_depth, w) ||
        !is_light(w.throughput, record))
        return step;
    step.ray = pack_walk(w, h.ray.path, false, kInfinity);
    step.goes_on = true;
    return step;
}

/// connect: an eye vertex samples an emitter (s = 1) and is paired with light vertices.
template <Features F>
struct EyeConnect {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> vertices;
    Queue<ConnectionVertex> eye_vertices;
    LightVertices light_vertices;
    const uint32_t* last_vertex;  ///< per slot: of its light walk; null: pairs are made elsewhere
    Queue<PairItem> pairs;
    ConnectOutlet candidates;
    StageRecord* record;
    StageRecord* pairs_record;  ///< of connect_vertices

    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem item = load_vertex<F>(vertices, i);
        const EyeVertex z = {unpack_vertex<F>(scene, item), item.throughput, item.path, item.bits().depth()};
        const RngKey key = wave.key(z.path);
        pair(z, item.d, key);
        take(z.vertex, z.throughput, key, z.path, z.depth);
    }

    /// The first pair of the vertex `z`, which a ray along `d` met.
    AMBILUX_HD void pair(const EyeVertex& z, Vec3f d, const RngKey& key) const {
        uint32_t next = first_pair(z.path);
        const uint32_t light =
            next == kNone ? kNone : LightVertexSearch{policy, light_vertices, key, z.depth, z.vertex}.find(next);
        if (light == kNone) return;
        pairs.push({push_vertex<F>(eye_vertices, pack_connection_vertex(z.vertex, z.depth, d, z.throughput, z.path)),
                    light, z.path, next});
    }

    /// connect_vertices for all pairs of a vertex, in the same order and of the same vertices.
    AMBILUX_HD void connect_all(const EyeVertex& z, Vec3f d, const RngKey& key) const {
        const LightVertexSearch lights = {policy, light_vertices, key, z.depth, z.vertex};
        uint32_t next = first_pair(z.path), found = lights.find(next);
        if (found == kNone) return;
        const float scale = policy.cache_draws > 0 ? draw_scale(wave, policy, light_vertices) : 1.0f;
        const EyeVertex packed =
            eye_vertex_of<F>(scene, pack_connection_vertex(z.vertex, z.depth, d, z.throughput, z.path));
        for (; found != kNone; found = lights.find(next)) {
            pairs_record->count_item(z.depth);
            push_connection<F>(scene, policy, key, packed, load_vertex<F>(light_vertices, found), scale, found,
                               candidates, pairs_record);
        }
    }

    AMBILUX_HD void take(const WalkVertex& z, Rgb throughput, const RngKey& key, uint32_t path, uint32_t depth) const {
        if (!policy.next_event || !policy.wants(1, depth + 1)) return;
        WalkConnection c;
        bool environment = false;
        if (!connect_next_event_deferred<F>(scene, policy.mis, z, throughput, random_floats(key, emitter_block(depth)),
                                            c, environment))
            return;
        if (environment) c.tmax = kTowardsEnvironment;
        if (!is_light(c.value, record) || is_zero(c.value)) return;
        candidates.push({c.value, path, 1.0f, policy.others(c.others),
                         F.opacity || policy.cull > 0.0f ? alpha_seed(key, depth, true) : 0, c.tmax, c.o,
                         Strategy::make(1, depth + 1), c.d, 0});
    }

private:
    /// Where LightVertexSearch::find starts; kNone: there is nothing to connect with.
    AMBILUX_HD uint32_t first_pair(uint32_t path) const {
        if (!policy.connect_vertices || !last_vertex) return kNone;
        return policy.cache_draws > 0 ? policy.cache_draws : last_vertex[path];
    }
};

template <Features F>
struct EyeShade {
    static constexpr uint32_t kBlocksPerSm =
        F.bsdfs == bit(BsdfType::diffuse)
            ? 5
            : 4;  ///< 102 or 128 registers instead of up to 232: more warps hide more latency (docs/performance.md)
    static constexpr bool kGathers =
        !F.several_bsdfs() && !F.has_environment();  ///< hits are in no order, and misses of no use

    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkHit> hits;
    Queue<WalkItem> rays;
    HitOutlet candidates;
    Queue<VertexItem> vertices;
    StageRecord* record;
    EyeConnect<F> connect;

    /// True if nothing comes of rays that meet nothing.
    AMBILUX_HD bool skips_misses() const { return !F.has_environment() || !policy.count_environment; }

    AMBILUX_HD void operator()(uint32_t i) const {
        WalkItem next;
        if (take(hit(i), next)) rays.push(next);
    }
    AMBILUX_HD WalkHit hit(uint32_t i) const { return hits.load(i); }

    /// True if the walk goes on with the ray `next`.
    AMBILUX_HD bool take(const WalkHit& h, WalkItem& next) const {
        const WalkStep step =
            eye_step<F>(scene, wave, policy, h, candidates, record, [&](const WalkVertex& z, const RngKey& key) {
                if (!policy.connect_in_shade) {
                    push_vertex<F>(vertices, pack_vertex(z, h));
                    return;
                }
                const EyeVertex eye = {z, h.ray.throughput, h.ray.path, h.ray.bits.depth()};
                connect.take(z, eye.throughput, key, eye.path, eye.depth);
#if !defined(__CUDA_ARCH__)
                if (policy.at_once) {
                    if (policy.connect_vertices) connect.connect_all(eye, h.ray.d, key);
                    return;
                }
#endif
                const Warp warp;
                connect.pair(eye, h.ray.d, key);
                warp.meet();  // else lanes that search longer than others stay apart
            });
        next = step.ray;
        return step.goes_on;
    }
};

}  // namespace ambilux
