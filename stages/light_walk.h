// light_generate and light_shade: walks that start at emitters.
#pragma once

#include "stages/bidirectional_policy.h"
#include "stages/stage.h"
#include "stages/walk_items.h"
#include "stages/wave.h"

namespace ambilux {

/// One light walk per slot, and the emitter itself as the camera sees it.
template <Features F>
struct LightGenerate {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkItem> rays;
    Queue<SplatCandidate> splats;
    uint32_t* last_vertex;  ///< per slot: the last vertex of its light walk
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        last_vertex[slot] = kNone;
        const PathSlot p = wave.locate(slot);
        if (!p.active || policy.max_depth == 0) return;
        const RngKey key = wave.key(p, Stream::light);
        const Vec4f direction = random_floats(key, kEmissionBlock + 1);
        EmissionSample e;
        if (!sample_emission<F>(scene, random_floats(key, kEmissionBlock), {direction.x, direction.y}, e)) return;
        const Walk w = start_light_walk(e);
        if (!is_light(w.throughput, record)) return;
        if (policy.splat && !policy.hide_emitters && policy.wants(1, 1)) {
            WalkConnection c;
            Vec2f film;
            if (connect_visible_light<F>(scene, policy.mis, e, {direction.z, direction.w}, c, film) && is_light(c.value, record) && !is_zero(c.value))
                splats.push({c.value, slot, c.o, c.tmax, c.d, F.opacity ? alpha_seed(key, 0, true) : 0, film, policy.others(c.others), Strategy::make(1, 1)});
        }
        if (policy.max_depth >= 2) rays.push(pack_walk(w, slot, true, kInfinity));
    }
};

/// A light vertex: kept for connections, asked for by the camera, and left again.
template <Features F>
struct LightShade {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<WalkHit> hits;
    Queue<WalkItem> rays;
    Queue<VertexItem> vertices;       ///< all vertices of all light walks of the wave
    Queue<VertexItem> camera_vertices;  ///< those of this depth
    uint32_t* last_vertex;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const WalkHit h = hits.load(i);
        Walk w = unpack_walk(h.ray);
        const WalkVertex y = light_vertex<F>(scene, policy.mis, w, h.prim, h.u, h.v);
        // A path has at least one segment more than its light walk.
        if (w.depth >= policy.max_depth) return;
        if (bsdf_is_smooth(y.scattering.bsdf)) {
            VertexItem item = pack_vertex(h, y, kNone);
            if (policy.splat && policy.wants(w.depth + 1, 1)) camera_vertices.push(item);
            if (policy.connect_vertices && w.depth + 2 <= policy.max_depth) {
                item.previous = last_vertex[h.ray.path];
                last_vertex[h.ray.path] = vertices.push(item);
            }
        }
        if (w.depth + 1 >= policy.max_depth) return;
        const uint32_t depth = w.depth;
        const Vec4f u = random_floats(wave.key(h.ray.path, Stream::light), light_scatter_block(depth));
        if (!scatter_walk<F>(policy.mis, y, u, TransportMode::importance, policy.rr_depth, w)) return;
        if (is_light(w.throughput, record)) rays.push(pack_walk(w, h.ray.path, true, kInfinity));
    }
};

/// connect_camera: light vertices of one depth and the camera (t = 1).
template <Features F>
struct ConnectCamera {
    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> vertices;
    Queue<SplatCandidate> splats;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const VertexItem item = vertices.load(i);
        const WalkVertex y = unpack_vertex<F>(scene, item);
        const RngKey key = wave.key(item.path, Stream::light);
        const Vec4f u = random_floats(key, lens_block(item.bits.depth()));
        WalkConnection c;
        Vec2f film;
        if (!connect_camera<F>(scene, policy.mis, y, item.throughput, {u.x, u.y}, c, film)) return;
        if (!is_light(c.value, record) || is_zero(c.value)) return;
        splats.push({c.value, item.path, c.o, c.tmax, c.d, F.opacity ? alpha_seed(key, item.bits.depth(), true) : 0, film, policy.others(c.others),
                     Strategy::make(item.bits.depth() + 1, 1)});
    }
};

}  // namespace ambilux
