// generate, shade, connect and connect_vertices of bidirectional path tracing: walks that start at the camera.
#pragma once

#include "core/warp.h"
#include "stages/bidirectional_policy.h"
#include "stages/generate.h"
#include "stages/mis_weight.h"
#include "stages/stage.h"
#include "stages/vertex_items.h"

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

/// An eye walk at `h`: emission becomes a candidate, and visit(vertex, random numbers of the walk) is called where connections may start.
template <Features F, class Visit>
AMBILUX_HD WalkStep eye_step(const SceneView& scene, const Wave& wave, const BidirectionalPolicy& policy, const WalkHit& h, const HitOutlet& candidates, StageRecord* record, Visit visit) {
    const auto emit = [&](Rgb radiance, float others) {
        const Strategy strategy = Strategy::make(0, h.ray.bits.depth() + 1);
        if (!policy.singles.has(strategy)) return;
        const Rgb value = h.ray.throughput * radiance;
        if (is_light(value, record) && !is_zero(value)) candidates.push({value, h.ray.path, 1.0f, policy.others(others), strategy, 0});
    };
    WalkStep step = {};
    Walk w = unpack_walk(h.ray);
    const bool visible = !(policy.hide_emitters && w.depth == 1);
    if (h.prim == kNone) {
        if constexpr (F.has_environment())
            if (policy.counts_environment(w.depth) && visible) emit(environment_radiance<F>(scene, w.d), others_of_escape<F>(scene, policy.mis, w.sums, w.depth, w.d));
        return step;
    }
    if (policy.background_only) return step;
    const WalkVertex z = eye_vertex<F>(scene, policy.mis, w, h.prim, h.u, h.v);
    const uint32_t emitter = scene.shapes[z.point.shape].emitter;
    if (policy.count_hits && visible && emitter != kNone) {
        const Rgb radiance = emitted_radiance<F>(scene, emitter, z.point, -w.d);
        if (!is_zero(radiance)) emit(radiance, others_of_hit<F>(scene, policy.mis, w.sums, w.depth, emitter, w.o, w.d, w.start_distance, z.point));
    }
    if (w.depth >= policy.max_depth) return step;
    const RngKey key = wave.key(h.ray.path);
    if ((policy.next_event || policy.connect_vertices) && bsdf_is_smooth(z.scattering.bsdf)) {
        visit(z, key);
    }
    const uint32_t depth = w.depth;
    if (depth + 1 == policy.max_depth && !policy.counts_last_segment()) return step;
    const Vec4f u = random_floats(key, scatter_block(depth));
    if (!scatter_walk<F>(policy.mis, z, u, TransportMode::radiance, policy.rr_depth, w) || !is_light(w.throughput, record)) return step;
    step.ray = pack_walk(w, h.ray.path, false, kInfinity);
    step.goes_on = true;
    return step;
}

/// Which of `size` light vertices the draw of an eye vertex finds, whose walk has the random numbers `key`: each with the same probability. On a device threads of a warp that draw together find
/// vertices that lie together, from a random place of the cache on: so does what they load, and mostly it was left by walks on one material.
AMBILUX_HD uint32_t drawn_vertex(const RngKey& key, uint32_t depth, uint32_t draw, uint32_t size) {
    const uint32_t block = cache_block(depth, draw);
#if defined(__CUDA_ARCH__)
    const uint32_t together = __activemask(), rank = lane_rank(together);
    const int first = __ffs(int(together)) - 1;
    const RngKey shared = {key.seed, __shfl_sync(together, key.index, first), __shfl_sync(together, key.sample, first), key.stream};
    const uint32_t at = mul_hi(random_bits(shared, __shfl_sync(together, block, first)).x, size) + rank;
    return at < size ? at : at % size;
#else
    return mul_hi(random_bits(key, block).x, size);
#endif
}

/// Goes through the light vertices that an eye vertex may be connected with.
struct LightVertexSearch {
    const BidirectionalPolicy& policy;
    const LightVertices& light_vertices;
    const RngKey& key;      ///< of the eye walk
    uint32_t depth;         ///< of the eye vertex `z`
    const WalkVertex& z;

    /// The next one, kNone if there is none, from `next` on, which goes on: a vertex of the light walk of the same slot, or, over a cache, the number of draws that are left.
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        const bool drawn = policy.cache_draws > 0;
        const uint32_t size = light_vertices.counter->size();
        if (size == 0 || depth + 2 > policy.max_depth) next = kNone;
        while (next != kNone) {
            uint32_t light = next;
            if (drawn) light = drawn_vertex(key, depth, --next, size);
            const ConnectionVertexFront y = light_vertices.load_front(light);
            if (!drawn)
                next = y.link;
            else if (next == 0)
                next = kNone;
            if (depth + y.bits.depth() + 1 <= policy.max_depth && may_connect(y, z)) return light;
        }
        return kNone;
    }
};

/// Pairs of the vertex that `search` is for, for one launch over `vertices` of them, from `next` on. place(): of the vertex in its queue, asked once and only if there is a pair.
template <class Place>
AMBILUX_HD void push_pairs(const LightVertexSearch& search, uint32_t vertices, uint32_t path, uint32_t next, const Queue<PairItem>& pairs, Place place) {
    uint32_t light = search.find(next);
    if (light == kNone) return;
    const uint32_t vertex = place();
    for (uint32_t left = vertices < search.policy.one_pair_from ? search.policy.pairs_per_launch : 1; light != kNone;) {
        const bool last = --left == 0;
        const uint32_t following = last ? kNone : search.find(next);
        pairs.push({vertex, light, path, last ? next : kNone});
        light = following;
    }
}

/// A vertex of the eye walk of `path`.
struct EyeVertex {
    WalkVertex vertex;
    Rgb throughput;
    uint32_t path, depth;
};

template <Features F>
AMBILUX_HD EyeVertex eye_vertex_of(const SceneView& scene, const ConnectionVertex& item) { return {unpack_vertex<F>(scene, item), item.throughput, item.path(), item.bits().depth()}; }

/// Candidate of the eye vertex `z` and light vertex `light`, worth `scale` times their product. `place`: of the light vertex in its cache.
template <Features F>
AMBILUX_HD_ONCE void push_connection(const SceneView& scene, const BidirectionalPolicy& policy, const RngKey& key, const EyeVertex& z, const ConnectionVertex& light, float scale, uint32_t place,
                                     const ConnectOutlet& candidates, StageRecord* record) {
    const uint32_t light_depth = light.front.bits.depth();
    const Strategy strategy = Strategy::make(light_depth + 1, z.depth + 1);
    if (!policy.singles.has(strategy) || is_zero(light.throughput) || is_zero(z.throughput)) return;  // black diffuse surfaces
    const WalkVertex y = unpack_vertex<F>(scene, light);
    WalkConnection c;
    if (!connect_vertices<F>(policy.mis, y, light.throughput, z.vertex, z.throughput, c)) return;
    c.value *= scale;
    if (!is_light(c.value, record) || is_zero(c.value)) return;
    uint32_t seed = 0;
    if (F.opacity || policy.cull > 0.0f) {
        const uint32_t which = policy.cache_draws > 0 ? WalkBits::kMaxDepth + place : light_depth;
        seed = alpha_seed(key, z.depth + (which << WalkBits::kDepthBits), true);
    }
    candidates.push({c.value, z.path, 1.0f, policy.others(c.others), seed, c.tmax, c.o, strategy, c.d, 0});
}

/// What a draw from a cache is worth: M vertices of N walks are in it, and k draws estimate the sum over a walk's vertices by M / (N k) times theirs.
AMBILUX_HD float draw_scale(const Wave& wave, const BidirectionalPolicy& policy, const LightVertices& light_vertices) {
    return float(light_vertices.counter->size()) / (float(wave.state->light_walks) * float(policy.cache_draws));
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
        pair(z, item.d, key, vertices.counter->size());
        take(z.vertex, z.throughput, key, z.path, z.depth);
    }

    /// The first pairs of the vertex `z`, which a ray along `d` met. `count`: of vertices in this launch, or more.
    AMBILUX_HD void pair(const EyeVertex& z, Vec3f d, const RngKey& key, uint32_t count) const {
        const uint32_t first = first_pair(z.path);
        if (first != kNone)
            push_pairs({policy, light_vertices, key, z.depth, z.vertex}, count, z.path, first, pairs,
                       [&] { return push_vertex<F>(eye_vertices, pack_connection_vertex(z.vertex, z.depth, d, z.throughput, z.path)); });
    }

    /// connect_vertices for all that pair() would push, in the same order and of the same vertices.
    AMBILUX_HD void connect_all(const EyeVertex& z, Vec3f d, const RngKey& key) const {
        const LightVertexSearch lights = {policy, light_vertices, key, z.depth, z.vertex};
        uint32_t next = first_pair(z.path), found = lights.find(next);
        if (found == kNone) return;
        const float scale = policy.cache_draws > 0 ? draw_scale(wave, policy, light_vertices) : 1.0f;
        const EyeVertex packed = eye_vertex_of<F>(scene, pack_connection_vertex(z.vertex, z.depth, d, z.throughput, z.path));
        for (; found != kNone; found = lights.find(next)) {
            pairs_record->count_item(z.depth);
            push_connection<F>(scene, policy, key, packed, load_vertex<F>(light_vertices, found), scale, found, candidates, pairs_record);
        }
    }

    AMBILUX_HD void take(const WalkVertex& z, Rgb throughput, const RngKey& key, uint32_t path, uint32_t depth) const {
        if (!policy.next_event || !policy.wants(1, depth + 1)) return;
        WalkConnection c;
        bool environment = false;
        if (!connect_next_event_deferred<F>(scene, policy.mis, z, throughput, random_floats(key, emitter_block(depth)), c, environment)) return;
        if (environment) c.tmax = kTowardsEnvironment;
        if (!is_light(c.value, record) || is_zero(c.value)) return;
        candidates.push({c.value, path, 1.0f, policy.others(c.others), F.opacity || policy.cull > 0.0f ? alpha_seed(key, depth, true) : 0, c.tmax, c.o, Strategy::make(1, depth + 1), c.d, 0});
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
    static constexpr uint32_t kBlocksPerSm = F.bsdfs == bit(BsdfType::diffuse) ? 5 : 4;  ///< 102 or 128 registers instead of up to 232: more warps hide more latency (docs/performance.md)
    static constexpr bool kGathers = !F.several_bsdfs() && !F.has_environment();  ///< hits are in no order, and misses of no use

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
        if (take(hit(i), hits.counter->size(), next)) rays.push(next);
    }
    AMBILUX_HD WalkHit hit(uint32_t i) const { return hits.load(i); }

    /// True if the walk goes on with the ray `next`. `count`: of hits in this launch, or more.
    AMBILUX_HD bool take(const WalkHit& h, uint32_t count, WalkItem& next) const {
        const WalkStep step = eye_step<F>(scene, wave, policy, h, candidates, record, [&](const WalkVertex& z, const RngKey& key) {
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
            connect.pair(eye, h.ray.d, key, count);
            warp.meet();  // else lanes that search longer than others stay apart
        });
        next = step.ray;
        return step.goes_on;
    }
};

/// An eye vertex that pairs one after the other may have in common.
struct PairedVertex {
    uint32_t place = kNone;  ///< in the queue of its depth
    EyeVertex z;
};

/// connect_vertices: an eye vertex and a light vertex (s, t >= 2), of the light walk of its slot, or drawn from a cache of those of all light walks of the wave (Davidovic et al. 2014).
template <Features F>
struct ConnectVertices {
    static constexpr uint32_t kBlocksPerSm = F.bsdfs == bit(BsdfType::diffuse) ? 5 : 4;

    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<PairItem> pairs, rest;
    Queue<ConnectionVertex> vertices;
    LightVertices light_vertices;
    ConnectOutlet candidates;
    StageRecord* record;

    /// What an executor that goes through items one after the other may keep from one to the next.
    using Memory = PairedVertex;

    AMBILUX_HD void operator()(uint32_t i) const {
        Memory eye;
        (*this)(i, eye);
    }
    AMBILUX_HD void operator()(uint32_t i, Memory& eye) const {
        const PairItem pair = pairs.load(i);
        const ConnectionVertex light = load_vertex<F>(light_vertices, pair.light);  // before anything waits for the eye vertex
        if (eye.place != pair.vertex) {
            eye.place = pair.vertex;
            eye.z = eye_vertex_of<F>(scene, load_vertex<F>(vertices, pair.vertex));
        }
        const RngKey key = wave.key(pair.path);
        const Warp warp;
        if (pair.next != kNone)
            push_pairs({policy, light_vertices, key, eye.z.depth, eye.z.vertex}, pairs.counter->size(), pair.path, pair.next, rest, [&] { return pair.vertex; });
        warp.meet();
        push_connection<F>(scene, policy, key, eye.z, light, policy.cache_draws > 0 ? draw_scale(wave, policy, light_vertices) : 1.0f, pair.light, candidates, record);
    }
};

}  // namespace ambilux
