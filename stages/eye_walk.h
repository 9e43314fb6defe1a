// generate, shade, connect and connect_vertices of bidirectional path tracing: walks that start at the camera.
#pragma once

#include "stages/bidirectional_policy.h"
#include "stages/generate.h"
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
        samples[slot] = {};
        const PathSlot p = wave.locate(slot);
        if (!p.active || policy.max_depth == 0) return;
        const CameraSample c = camera_sample(scene, wave, p);
        rays.push(pack_walk(start_eye_walk(scene, policy.mis, c), slot, false, c.tmax));
    }
};

/// An eye walk at `h`: emission becomes a candidate.
template <Features F>
AMBILUX_HD WalkStep eye_step(const SceneView& scene, const Wave& wave, const BidirectionalPolicy& policy, const WalkHit& h, const Queue<HitCandidate>& candidates, StageRecord* record) {
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
    if ((policy.next_event || policy.connect_vertices) && bsdf_is_smooth(z.scattering.bsdf)) {
        step.vertex = pack_vertex(h, z, kNone);
        step.connectable = true;
    }
    const uint32_t depth = w.depth;
    if (depth + 1 == policy.max_depth && !policy.counts_last_segment()) return step;
    const Vec4f u = random_floats(wave.key(h.ray.path), scatter_block(depth));
    if (!scatter_walk<F>(policy.mis, z, u, TransportMode::radiance, policy.rr_depth, w) || !is_light(w.throughput, record)) return step;
    step.ray = pack_walk(w, h.ray.path, false, kInfinity);
    step.goes_on = true;
    return step;
}

template <Features F>
struct EyeShade {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkHit> hits;
    Queue<WalkItem> rays;
    Queue<HitCandidate> candidates;
    Queue<VertexItem> vertices;
    const uint32_t* last_vertex;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const WalkHit h = hits.load(i);
        WalkStep step = eye_step<F>(scene, wave, policy, h, candidates, record);
        if (step.connectable) {
            if (policy.connect_vertices) step.vertex.previous = policy.cache_draws > 0 ? policy.cache_draws : last_vertex[h.ray.path];
            vertices.push(step.vertex);
        }
        if (step.goes_on) rays.push(step.ray);
    }
};

/// connect: an eye vertex samples an emitter (s = 1) and goes on to the vertices of its light walk.
template <Features F>
struct EyeConnect {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> vertices;
    Queue<VertexItem> pairs;
    Queue<ConnectCandidate> candidates;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem item = vertices.load(i);
        if (item.previous != kNone) pairs.push(item);
        const uint32_t depth = item.bits.depth();
        if (!policy.next_event || !policy.wants(1, depth + 1)) return;
        const RngKey key = wave.key(item.path);
        const WalkVertex z = unpack_vertex<F>(scene, item);
        WalkConnection c;
        if (!connect_next_event<F>(scene, policy.mis, z, item.throughput, random_floats(key, emitter_block(depth)), c)) return;
        if (!is_light(c.value, record) || is_zero(c.value)) return;
        candidates.push({c.value, item.path, 1.0f, policy.others(c.others), F.opacity ? alpha_seed(key, depth, true) : 0, c.tmax, c.o, Strategy::make(1, depth + 1), c.d, 0});
    }
};

/// Candidate of eye vertex `item` and light vertex `light`, worth `scale` times their product.
template <Features F>
AMBILUX_HD void push_connection(const SceneView& scene, const BidirectionalPolicy& policy, const RngKey& key, const VertexItem& item, const VertexItem& light, float scale,
                                uint32_t which, const Queue<ConnectCandidate>& candidates, StageRecord* record) {
    const Strategy strategy = Strategy::make(light.bits.depth() + 1, item.bits.depth() + 1);
    if (!policy.singles.has(strategy)) return;
    const WalkVertex z = unpack_vertex<F>(scene, item), y = unpack_vertex<F>(scene, light);
    WalkConnection c;
    if (!connect_vertices<F>(policy.mis, y, light.throughput, z, item.throughput, c)) return;
    c.value *= scale;
    if (!is_light(c.value, record) || is_zero(c.value)) return;
    uint32_t seed = 0;
    if constexpr (F.opacity) seed = alpha_seed(key, item.bits.depth() + (which << WalkBits::kDepthBits), true);
    candidates.push({c.value, item.path, 1.0f, policy.others(c.others), seed, c.tmax, c.o, strategy, c.d, 0});
}

/// connect_vertices: an eye vertex and one vertex of the light walk of its slot (s, t >= 2); what is left of that walk is for the next launch, so that no launch
/// holds two contributions of one path.
template <Features F>
struct ConnectVertices {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> pairs, rest;
    Queue<VertexItem> light_vertices;
    Queue<ConnectCandidate> candidates;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        VertexItem item = pairs.load(i);
        const uint32_t depth = item.bits.depth();
        VertexItem light = light_vertices.load(item.previous);
        while (depth + light.bits.depth() + 1 > policy.max_depth) {
            if (light.previous == kNone) return;
            light = light_vertices.load(light.previous);
        }
        item.previous = light.previous;
        if (light.previous != kNone) rest.push(item);
        push_connection<F>(scene, policy, wave.key(item.path), item, light, 1.0f, light.bits.depth(), candidates, record);
    }
};

/// connect_vertices over a cache (Davidovic et al. 2014): an eye vertex and one vertex drawn from those of all light walks of the wave. VertexItem::previous of the eye
/// vertex counts the draws that are left. M vertices of N walks are in the cache; k draws estimate the sum over a walk's vertices by M / (N k) times theirs.
template <Features F>
struct ConnectCache {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> pairs, rest;
    Queue<VertexItem> light_vertices;
    Queue<ConnectCandidate> candidates;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t size = light_vertices.counter->size();
        if (size == 0) return;
        VertexItem item = pairs.load(i);
        const uint32_t depth = item.bits.depth(), draw = --item.previous;
        if (draw > 0) rest.push(item);
        const RngKey key = wave.key(item.path);
        const VertexItem light = light_vertices.load(mul_hi(random_bits(key, cache_block(depth, draw)).x, size));
        if (depth + light.bits.depth() + 1 > policy.max_depth) return;
        const float scale = float(size) / (float(wave.state->walks) * float(policy.cache_draws));
        push_connection<F>(scene, policy, key, item, light, scale, WalkBits::kMaxDepth + draw, candidates, record);
    }
};

}  // namespace ambilux
