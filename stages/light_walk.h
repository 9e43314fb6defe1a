// light_generate and light_shade: walks that start at emitters.
#pragma once

#include "items/vertex_items.h"
#include "queues/wave.h"
#include "stages/bidirectional_policy.h"
#include "stages/splat.h"
#include "stages/stage.h"

namespace ambilux {

/// Which of the light walks of a path this is: streams start one for every eye vertex, the others one, numbered 0, or
/// in rounds several that differ by their keys (Wave::first_key).
struct LightWalkNumber {
    uint32_t n;

    /// Random numbers of walk 0 are those of paired walks.
    AMBILUX_HD uint32_t block(uint32_t block_of_first) const { return block_of_first + (n << 16); }
    AMBILUX_HD uint32_t alpha_depth(uint32_t depth) const { return depth + (n << WalkBits::kDepthBits); }
};

/// Starts light walk `number` of `path`; walk 0 also shows the emitter itself to the camera. False if there is no first
/// ray.
template <Features F>
AMBILUX_HD bool start_light(const SceneView& scene, const Wave& wave, const BidirectionalPolicy& policy, uint32_t path,
                            LightWalkNumber number, const SplatOutlet& splats, StageRecord* record, Walk& w) {
    const RngKey key = wave.key(path, Stream::light);
    const Vec4f direction = random_floats(key, number.block(kEmissionBlock + 1));
    EmissionSample e;
    if (!sample_emission<F>(scene, random_floats(key, number.block(kEmissionBlock)), {direction.x, direction.y}, e))
        return false;
    w = start_light_walk(e);
    if (!is_light(w.throughput, record)) return false;
    if (number.n == 0 && policy.splat && !policy.hide_emitters && policy.wants(1, 1)) {
        WalkConnection c;
        Vec2f film;
        if (connect_visible_light<F>(scene, policy.mis, e, {direction.z, direction.w}, c, film) &&
            is_light(c.value, record) && !is_zero(c.value))
            splats.push({c.value, path, c.o, c.tmax, c.d, F.opacity ? alpha_seed(key, 0, true) : 0, film,
                         policy.others(c.others), Strategy::make(1, 1)});
    }
    return policy.max_depth >= 2;
}

/// A light walk at `h`, where it may have `longest` segments in all. visit(vertex, random numbers of the walk) is
/// called where connections may start.
template <Features F, class Visit>
AMBILUX_HD WalkStep light_step(const SceneView& scene, const Wave& wave, const BidirectionalPolicy& policy,
                               const WalkHit& h, LightWalkNumber number, uint32_t longest, StageRecord* record,
                               Visit visit) {
    WalkStep step = {};
    Walk w = unpack_walk(h.ray);
    const WalkVertex y = light_vertex<F>(scene, policy.mis, w, h.prim, h.u, h.v);
    const RngKey key = wave.key(h.ray.path, Stream::light);
    if (bsdf_is_smooth(y.scattering.bsdf)) {
        visit(y, key);
    }
    if (w.depth >= longest) return step;
    const Vec4f u = random_floats(key, number.block(light_scatter_block(w.depth)));
    if (!scatter_walk<F>(policy.mis, y, u, TransportMode::importance, policy.rr_depth, w) ||
        !is_light(w.throughput, record))
        return step;
    step.ray = pack_walk(w, h.ray.path, true, kInfinity);
    step.goes_on = true;
    return step;
}

/// A light walk in each slot that has one in this round, and the emitter itself as the camera sees it.
template <Features F>
struct LightGenerate {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkItem> rays;
    SplatOutlet splats;
    uint32_t* last_vertex;  ///< per slot: the last vertex of its light walk
    StageRecord* record;
    uint32_t round = 0;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (policy.cache_draws == 0) last_vertex[slot] = kNone;
        if (round >= light_walks_of(slot, policy.light_walks_per_tile) || !wave.locate(slot).active ||
            policy.max_depth == 0)
            return;
        Walk w;
        if (start_light<F>(scene, wave, policy, slot, {0}, splats, record, w))
            rays.push(pack_walk(w, slot, true, kInfinity));
    }
};

/// connect_camera: light vertices of one depth and the camera (t = 1).
template <Features F>
struct ConnectCamera {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> vertices;
    SplatOutlet splats;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem item = load_vertex<F>(vertices, i);
        take(unpack_vertex<F>(scene, item), item.throughput, wave.key(item.path, Stream::light), item.path,
             item.bits().depth());
    }

    AMBILUX_HD void take(const WalkVertex& y, Rgb throughput, const RngKey& key, uint32_t path, uint32_t depth) const {
        const Vec4f u = random_floats(key, lens_block(depth));
        WalkConnection c;
        Vec2f film;
        if (!connect_camera<F>(scene, policy.mis, y, throughput, {u.x, u.y}, c, film)) return;
        if (!is_light(c.value, record) || is_zero(c.value)) return;
        splats.push({c.value, path, c.o, c.tmax, c.d, F.opacity ? alpha_seed(key, depth, true) : 0, film,
                     policy.others(c.others), Strategy::make(depth + 1, 1)});
    }
};

/// A light vertex: kept for connections, connected with the camera, and left again.
template <Features F>
struct LightShade {
    static constexpr uint32_t kBlocksPerSm = F.bsdfs == bit(BsdfType::diffuse) ? 5 : 4;

    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkHit> hits;
    Queue<WalkItem> rays;
    LightVertices vertices;             ///< all vertices of all light walks of the wave
    Queue<VertexItem> camera_vertices;  ///< those of this depth
    uint32_t* last_vertex;
    StageRecord* record;
    ConnectCamera<F> connect;

    /// Nothing comes of rays that meet nothing.
    AMBILUX_HD bool skips_misses() const { return true; }

    AMBILUX_HD void operator()(uint32_t i) const {
        WalkItem next;
        if (take(hit(i), next)) rays.push(next);
    }
    AMBILUX_HD WalkHit hit(uint32_t i) const { return hits.load(i); }

    /// True if the walk goes on with the ray `next`.
    AMBILUX_HD bool take(const WalkHit& h, WalkItem& next) const {
        if (h.prim == kNone) return false;
        const uint32_t depth = h.ray.bits.depth();
        const bool to_camera = policy.splat && depth < policy.max_depth && policy.wants(depth + 1, 1);
        // A path has at least one segment more than its light walk.
        WalkStep step = light_step<F>(
            scene, wave, policy, h, {0}, policy.max_depth - 1, record, [&](const WalkVertex& y, const RngKey& key) {
                if (to_camera && policy.connect_in_shade) connect.take(y, h.ray.throughput, key, h.ray.path, depth);
                if (to_camera && !policy.connect_in_shade) push_vertex<F>(camera_vertices, pack_vertex(y, h));
                if (policy.connect_vertices && depth + 2 <= policy.max_depth) {
                    const bool chained = policy.cache_draws == 0;
                    const uint32_t place =
                        push_vertex<F>(vertices, pack_connection_vertex(y, depth, h.ray.d, h.ray.throughput,
                                                                        chained ? last_vertex[h.ray.path] : kNone));
                    if (chained) last_vertex[h.ray.path] = place;
                }
            });
        next = step.ray;
        return step.goes_on;
    }
};

}  // namespace ambilux
