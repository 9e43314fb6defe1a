// generate, shade, connect and connect_vertices of bidirectional path tracing: walks that start at the camera.
#pragma once

#include "stages/bidirectional_policy.h"
#include "stages/generate.h"
#include "stages/mis_weight.h"
#include "stages/stage.h"
#include "stages/walk_items.h"

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

/// An eye walk at `h`: emission becomes a candidate, and visit(vertex, its item, random numbers of the walk) is called where connections may start.
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
        step.vertex = pack_vertex(h, z, kNone);
        step.connectable = true;
        visit(z, step.vertex, key);
    }
    const uint32_t depth = w.depth;
    if (depth + 1 == policy.max_depth && !policy.counts_last_segment()) return step;
    const Vec4f u = random_floats(key, scatter_block(depth));
    if (!scatter_walk<F>(policy.mis, z, u, TransportMode::radiance, policy.rr_depth, w) || !is_light(w.throughput, record)) return step;
    step.ray = pack_walk(w, h.ray.path, false, kInfinity);
    step.goes_on = true;
    return step;
}

/// Which of `size` light vertices the draw of an eye vertex finds: each with the same probability. On a device vertices that lie together in their queue draw together, from a random place of
/// the cache on: what they load lies together too, and mostly was left by walks on one material.
AMBILUX_HD uint32_t drawn_vertex(const Wave& wave, [[maybe_unused]] uint32_t vertex, [[maybe_unused]] uint32_t path, uint32_t depth, uint32_t draw, uint32_t size) {
#if defined(__CUDA_ARCH__)
    const RngKey key = {wave.seed, vertex / kDrawsTogether, wave.state->first_sample, Stream::eye};
    const uint32_t at = mul_hi(random_bits(key, cache_block(depth, draw)).x, size) + vertex % kDrawsTogether;
    return at < size ? at : at % size;
#else
    return mul_hi(random_bits(wave.key(path), cache_block(depth, draw)).x, size);
#endif
}

/// Pairs of an eye vertex for one launch over `vertices` of them, from `next` on: a vertex of the light walk of its slot, or, over a cache, the number of draws that are left.
AMBILUX_HD void push_pairs(const Wave& wave, const BidirectionalPolicy& policy, const LightVertices& light_vertices, uint32_t vertices, uint32_t vertex, uint32_t path, uint32_t depth, uint32_t next,
                           const Queue<PairItem>& pairs) {
    const uint32_t most = vertices < policy.one_pair_from ? policy.pairs_per_launch : 1;
    if (policy.cache_draws > 0) {
        const uint32_t size = light_vertices.counter->size();
        if (size == 0) return;
        for (uint32_t pushed = 1; next > 0 && pushed <= most; ++pushed) {
            --next;
            const uint32_t light = drawn_vertex(wave, vertex, path, depth, next, size);
            pairs.push({vertex, light, path, pushed == most && next > 0 ? next : kNone});
        }
        return;
    }
    for (uint32_t pushed = 0; next != kNone && pushed < most;) {
        const uint32_t light = next;
        const VertexItem y = light_vertices.load(light);
        next = y.previous;
        if (depth + y.bits.depth() + 1 > policy.max_depth) continue;
        ++pushed;
        pairs.push({vertex, light, path, pushed == most ? next : kNone});
    }
}

/// Candidate of the eye vertex `z`, which `item` stands for, and light vertex `light`, worth `scale` times their product.
template <Features F>
AMBILUX_HD_ONCE void push_connection(const SceneView& scene, const BidirectionalPolicy& policy, const RngKey& key, const VertexItem& item, const WalkVertex& z, const VertexItem& light, float scale,
                                uint32_t which, const ConnectOutlet& candidates, StageRecord* record) {
    const Strategy strategy = Strategy::make(light.bits.depth() + 1, item.bits.depth() + 1);
    if (!policy.singles.has(strategy)) return;
    const SurfacePoint at = surface_of<F>(scene, light);
    if (!may_connect(scene, at, -light.d, z.point, -item.d)) return;
    const WalkVertex y = unpack_vertex<F>(scene, light, at);
    WalkConnection c;
    if (!connect_vertices<F>(policy.mis, y, light.throughput, z, item.throughput, c)) return;
    c.value *= scale;
    if (!is_light(c.value, record) || is_zero(c.value)) return;
    uint32_t seed = 0;
    if (F.opacity || policy.cull > 0.0f) seed = alpha_seed(key, item.bits.depth() + (which << WalkBits::kDepthBits), true);
    candidates.push({c.value, item.path, 1.0f, policy.others(c.others), seed, c.tmax, c.o, strategy, c.d, 0});
}

/// What a draw from a cache is worth: M vertices of N walks are in it, and k draws estimate the sum over a walk's vertices by M / (N k) times theirs.
AMBILUX_HD float draw_scale(const Wave& wave, const BidirectionalPolicy& policy, const LightVertices& light_vertices) {
    return float(light_vertices.counter->size()) / (float(wave.state->walks) * float(policy.cache_draws));
}

/// connect: an eye vertex samples an emitter (s = 1) and is paired with the vertices of its light walk.
template <Features F>
struct EyeConnect {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> vertices;
    LightVertices light_vertices;
    Queue<PairItem> pairs;
    ConnectOutlet candidates;
    StageRecord* record;
    StageRecord* pairs_record;  ///< of connect_vertices

    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem item = vertices.load(i);
        pair(item, i, vertices.counter->size());
        if (policy.next_event) take(unpack_vertex<F>(scene, item), item.throughput, wave.key(item.path), item.path, item.bits.depth());
    }

    /// `count`: of vertices in this launch, or more.
    AMBILUX_HD void pair(const VertexItem& item, uint32_t place, uint32_t count) const {
        if (item.previous != kNone) push_pairs(wave, policy, light_vertices, count, place, item.path, item.bits.depth(), item.previous, pairs);
    }

    /// connect_vertices for all that pair() would push, in the same order.
    AMBILUX_HD void connect_all(const VertexItem& item, const WalkVertex& z) const {
        const RngKey key = wave.key(item.path);
        const uint32_t depth = item.bits.depth();
        const auto connect = [&](const VertexItem& light, float scale, uint32_t which) {
            pairs_record->count_item(depth);
            if (depth + light.bits.depth() + 1 <= policy.max_depth) push_connection<F>(scene, policy, key, item, z, light, scale, which, candidates, pairs_record);
        };
        if (policy.cache_draws > 0) {
            const uint32_t size = light_vertices.counter->size();
            for (uint32_t draw = size > 0 ? policy.cache_draws : 0; draw-- > 0;) {
                const uint32_t light = mul_hi(random_bits(key, cache_block(depth, draw)).x, size);
                connect(light_vertices.load(light), draw_scale(wave, policy, light_vertices), WalkBits::kMaxDepth + light);
            }
            return;
        }
        for (uint32_t next = item.previous; next != kNone;) {
            const VertexItem light = light_vertices.load(next);
            next = light.previous;
            if (depth + light.bits.depth() + 1 <= policy.max_depth) connect(light, 1.0f, light.bits.depth());
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
};

template <Features F>
struct EyeShade {
    static constexpr uint32_t kBlocksPerSm = F.bsdfs == bit(BsdfType::diffuse) ? 5 : F.textures ? 3 : 4;  ///< 102, 168 or 128 registers instead of up to 232: more warps hide more latency (docs/performance.md)
    static constexpr bool kGathers = !F.several_bsdfs() && !F.has_environment();  ///< hits are in no order, and misses of no use

    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkHit> hits;
    Queue<WalkItem> rays;
    HitOutlet candidates;
    Queue<VertexItem> vertices;
    const uint32_t* last_vertex;
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
        WalkStep step = eye_step<F>(scene, wave, policy, h, candidates, record, [&](const WalkVertex& z, [[maybe_unused]] VertexItem& item, const RngKey& key) {
            if (!policy.connect_in_shade) return;
            connect.take(z, h.ray.throughput, key, h.ray.path, h.ray.bits.depth());
#if !defined(__CUDA_ARCH__)
            if (!policy.at_once || !policy.connect_vertices) return;
            item.previous = last_vertex[h.ray.path];
            connect.connect_all(item, z);
#endif
        });
        if (step.connectable && !policy.at_once && (policy.connect_vertices || !policy.connect_in_shade)) {
            if (policy.connect_vertices) step.vertex.previous = policy.cache_draws > 0 ? policy.cache_draws : last_vertex[h.ray.path];
            const uint32_t place = vertices.push(step.vertex);
            if (policy.connect_in_shade) connect.pair(step.vertex, place, count);
        }
        next = step.ray;
        return step.goes_on;
    }
};

/// An eye vertex that pairs one after the other may have in common.
struct PairedVertex {
    uint32_t place = kNone;  ///< in the queue of its depth
    bool unpacked = false;
    VertexItem item;
    WalkVertex vertex;
};

/// connect_vertices: an eye vertex and a light vertex (s, t >= 2), of the light walk of its slot, or drawn from a cache of those of all light walks of the wave (Davidovic et al. 2014).
template <Features F>
struct ConnectVertices {
    static constexpr uint32_t kBlocksPerSm = F.bsdfs == bit(BsdfType::diffuse) ? 5 : 4;
    static constexpr bool kStrides = true;  ///< pairs that are not filtered are not taken in turns on a device: 1.17 of the time (docs/performance.md)

    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<PairItem> pairs, rest;
    Queue<VertexItem> vertices;
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
        push_next(pairs.load(i));
        connect(i, eye);
    }
    /// False if the pair brings nothing, told with less than a connection takes. Executors that can do so gather the others first, which then connect().
    /// Among diffuse surfaces a connection takes little more than that.
    AMBILUX_HD bool relevant(uint32_t i) const requires(F.bsdfs != bit(BsdfType::diffuse)) {
        const PairItem pair = pairs.load(i);
        const VertexItem light = light_vertices.load(pair.light), item = vertices.load(pair.vertex);
        push_next(pair);
        return item.bits.depth() + light.bits.depth() + 1 <= policy.max_depth && may_connect(scene, surface_of<F>(scene, light), -light.d, surface_of<F>(scene, item), -item.d);
    }
    AMBILUX_HD void connect(uint32_t i) const {
        Memory eye;
        connect(i, eye);
    }

private:
    AMBILUX_HD void push_next(const PairItem& pair) const {
        if (pair.next != kNone) push_pairs(wave, policy, light_vertices, pairs.counter->size(), pair.vertex, pair.path, vertices.load(pair.vertex).bits.depth(), pair.next, rest);
    }
    AMBILUX_HD void connect(uint32_t i, Memory& eye) const {
        const PairItem pair = pairs.load(i);
        if (eye.place != pair.vertex) {
            eye.place = pair.vertex;
            eye.unpacked = false;
            eye.item = vertices.load(pair.vertex);
        }
        const VertexItem light = light_vertices.load(pair.light);  // before anything waits for the eye vertex
        const VertexItem& item = eye.item;
        const uint32_t depth = item.bits.depth();
        if (depth + light.bits.depth() + 1 > policy.max_depth) return;
        const bool drawn = policy.cache_draws > 0;
        if (!eye.unpacked) eye.vertex = unpack_vertex<F>(scene, item);
        eye.unpacked = true;
        push_connection<F>(scene, policy, wave.key(item.path), item, eye.vertex, light, drawn ? draw_scale(wave, policy, light_vertices) : 1.0f,
                           drawn ? WalkBits::kMaxDepth + pair.light : light.bits.depth(), candidates, record);
    }
};

}  // namespace ambilux
