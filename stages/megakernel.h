// megakernel: one thread does a slot's light walk, its eye walk and all connections, with the functions that the stages
// use. It is a state machine of at most one ray per round, so that lanes of a warp trace together whatever their rays
// are for; lanes whose path has ended begin another (Novak et al. 2010, "Path Regeneration for Interactive Path
// Tracing").
#pragma once

#include "core/warp.h"
#include "items/vertex_items.h"
#include "stages/bidirectional_policy.h"
#include "stages/generate.h"
#include "stages/splat.h"
#include "stages/stage.h"

namespace ambilux {

template <Features F, class Tracer>
struct Megakernel {
    static constexpr uint32_t kBlocksPerSm = 4;    ///< on a device: 128 registers per thread
    static constexpr uint32_t kBeginTogether = 8;  ///< lanes without a path wait for as many before they begin new ones

    SceneView scene;
    Tracer tracer;
    Wave wave;
    BidirectionalPolicy policy;
    LightVertices
        light_vertices;  ///< memory for the vertices of all light walks; used through chains, never as a queue
    Queue<SplatItem> splats;
    Lane* samples;
    StageRecord* records;  ///< one per StageId: rays are counted where the stages would

    /// Does the slots `slot`, `slot + stride` ... below `end`, one after the other.
    AMBILUX_HD void run(uint32_t slot, uint32_t end, uint32_t stride) const {
        const Warp warp;
        Path path{};
        Counts counts{};
        for (;;) {
            const bool idle = !path.active && slot < end;
            const uint32_t waiting = warp.count(idle), working = warp.count(path.active);
            if (waiting + working == 0) break;
            if (idle && (working == 0 || waiting >= kBeginTogether)) {
                begin(path, slot);
                slot += stride;
            }

            warp.meet();
            Hit hit;
            bool met = false;
            const bool tested = path.testing, walked = !tested && path.walking && !connecting(path);
            if (tested || walked) met = trace(path, hit, counts);

            warp.meet();
            if (tested) {
                path.testing = false;
                if (!met) deliver(path);
            }
            if (walked) {
                path.walking = false;
                if (met)
                    shade(path, hit);
                else
                    escape(path);
            }

            warp.meet();
            if (!path.testing && connecting(path)) connect(path);

            warp.meet();
            if (path.active && !path.testing && !path.walking && !connecting(path)) {
                if (path.light)
                    begin_eye_walk(path);
                else
                    finish(path);
            }
        }
        add(StageId::light_extend, counts.light_rays);
        add(StageId::extend, counts.eye_rays);
        add(StageId::occlude, counts.shadow_rays);
    }

private:
    /// The vertex of the eye walk that is being connected. Its surface is looked up for every pair: a thread has no
    /// registers for it.
    struct WaitingVertex {
        Vec3f d;  ///< of the ray that met it
        uint32_t depth;
        float u, v;
        uint32_t prim;
        uint32_t next;  ///< the light vertex to connect next
        Rgb throughput;
        MisSums sums;
    };

    /// What a thread works on. Its next ray is the shadow ray if there is one, else, when the vertex has no connections
    /// left, that of the walk.
    struct Path {
        bool active;
        bool light;    ///< on the light walk; else on the eye walk
        bool walking;  ///< `walk` goes on
        bool testing;  ///< there is a shadow ray
        uint32_t slot;
        uint32_t last;  ///< vertex of the light walk
        Walk walk;
        float tmax;  ///< of the walk's ray
        WaitingVertex vertex;
        Ray shadow;
        Rgb value;   ///< arrives if the shadow ray is free:
        Vec2f film;  ///< there, from a light walk
        Rgb sum;     ///< of the eye walk
    };

    struct Counts {
        uint32_t light_rays, eye_rays, shadow_rays;
    };

    AMBILUX_HD StageRecord* record(StageId id) const { return records + uint32_t(id); }

    AMBILUX_HD void add(StageId id, uint32_t n) const {
        if (n == 0) return;
#if defined(__CUDA_ARCH__)
        atomicAdd(reinterpret_cast<unsigned long long*>(&record(id)->items), static_cast<unsigned long long>(n));
#else
        record(id)->items += n;
#endif
    }

    AMBILUX_HD RngKey key(const Path& path) const {
        return wave.key(path.slot, path.light ? Stream::light : Stream::eye);
    }

    /// A vertex past the capacity was not kept: the wave will be done again.
    AMBILUX_HD bool connecting(const Path& path) const { return path.vertex.next < light_vertices.capacity; }

    AMBILUX_HD void begin(Path& path, uint32_t slot) const {
        samples[slot] = {};
        path.active = policy.max_depth > 0 && wave.locate(slot).active;
        if (!path.active) return;
        path.light = true;
        path.slot = slot;
        path.last = kNone;
        path.vertex.next = kNone;
        if (policy.light_walks) begin_light_walk(path);
    }

    AMBILUX_HD void begin_light_walk(Path& path) const {
        const RngKey k = key(path);
        const Vec4f direction = random_floats(k, kEmissionBlock + 1);
        EmissionSample e;
        if (!sample_emission<F>(scene, random_floats(k, kEmissionBlock), {direction.x, direction.y}, e)) return;
        path.walk = start_light_walk(e);
        path.tmax = kInfinity;
        if (!is_light(path.walk.throughput, record(StageId::light_generate))) return;
        WalkConnection c;
        if (policy.splat && !policy.hide_emitters && policy.wants(1, 1) &&
            connect_visible_light<F>(scene, policy.mis, e, {direction.z, direction.w}, c, path.film))
            test(path, c, k, 0, StageId::light_generate);
        path.walking = policy.max_depth >= 2;
    }

    AMBILUX_HD void begin_eye_walk(Path& path) const {
        const CameraSample camera = camera_sample(scene, wave, wave.locate(path.slot));
        path.light = false;
        path.walk = start_eye_walk(scene, policy.mis, camera);
        path.tmax = camera.tmax;
        path.walking = true;
        path.sum = {0.0f, 0.0f, 0.0f};
    }

    AMBILUX_HD void finish(Path& path) const {
        set_start(samples[path.slot], path.sum);
        path.active = false;
    }

    AMBILUX_HD bool trace(const Path& path, Hit& hit, Counts& counts) const {
        const bool any_hit = path.testing;
        ++(any_hit ? counts.shadow_rays : path.light ? counts.light_rays : counts.eye_rays);
        Ray ray = path.shadow;
        if (!any_hit) {
            ray = {path.walk.o, path.tmax, path.walk.d, 0};
            if constexpr (F.opacity) ray.alpha_seed = alpha_seed(key(path), path.walk.depth, false);
        }
        return tracer.template trace<F>(scene, ray, any_hit, hit);
    }

    AMBILUX_HD void deliver(Path& path) const {
        if (!path.light) {
            path.sum += path.value;
            return;
        }
        const SplatItem item = {path.value, path.slot, path.film, Strategy::make(0, 0), 0.0f};
        splats.push(item);
    }

    /// The connection, weighted, asks for a shadow ray.
    AMBILUX_HD void test(Path& path, const WalkConnection& c, const RngKey& k, uint32_t which, StageId maker) const {
        if (!is_light(c.value, record(maker))) return;
        path.value = c.value * (1.0f / (1.0f + policy.others(c.others)));
        if (!is_light(path.value, record(StageId::mis_weight)) || is_zero(path.value)) return;
        path.shadow = {c.o, c.tmax, c.d, F.opacity ? alpha_seed(k, which, true) : 0};
        path.testing = true;
    }

    AMBILUX_HD bool emitters_shown(const Walk& w) const { return !(policy.hide_emitters && w.depth == 1); }

    AMBILUX_HD void add_emitted(Path& path, Rgb radiance, float others) const {
        if (!policy.wants(0, path.walk.depth + 1)) return;
        const Rgb value = path.walk.throughput * radiance;
        if (!is_light(value, record(StageId::shade)) || is_zero(value)) return;
        const Rgb weighted = value * (1.0f / (1.0f + policy.others(others)));
        if (is_light(weighted, record(StageId::mis_weight))) path.sum += weighted;
    }

    AMBILUX_HD void escape(Path& path) const {
        const Walk& w = path.walk;
        if (F.has_environment() && !path.light && policy.counts_environment(w.depth) && emitters_shown(w))
            add_emitted(path, environment_radiance<F>(scene, w.d),
                        others_of_escape<F>(scene, policy.mis, w.sums, w.depth, w.d));
    }

    /// The vertex that the walk met: emission, the connection with camera or emitter, and the next ray. Both walks go
    /// through the same code as far as they can.
    AMBILUX_HD void shade(Path& path, const Hit& hit) const {
        Walk& w = path.walk;
        const bool light = path.light;
        if (!light && policy.background_only) return;
        const RngKey k = key(path);
        WalkVertex x = walk_vertex<F>(scene, w.d, w.depth, hit.prim, hit.u, hit.v);
        x.sums = light ? light_sums<F>(scene, policy.mis, w, x.point) : eye_sums(scene, policy.mis, w, x.point);
        const uint32_t emitter = scene.shapes[x.point.shape].emitter;
        if (!light && policy.count_hits && emitter != kNone && emitters_shown(w)) {
            const Rgb radiance = emitted_radiance<F>(scene, emitter, x.point, -w.d);
            if (!is_zero(radiance))
                add_emitted(
                    path, radiance,
                    others_of_hit<F>(scene, policy.mis, w.sums, w.depth, emitter, w.o, w.d, w.start_distance, x.point));
        }
        if (w.depth >= policy.max_depth) return;
        if (bsdf_is_smooth(x.scattering.bsdf)) {
            const Vec4f u = random_floats(k, light ? lens_block(w.depth) : emitter_block(w.depth));
            WalkConnection c;
            const bool made = light
                                  ? policy.splat && policy.wants(w.depth + 1, 1) &&
                                        connect_camera<F>(scene, policy.mis, x, w.throughput, {u.x, u.y}, c, path.film)
                                  : policy.next_event && policy.wants(1, w.depth + 1) &&
                                        connect_next_event<F>(scene, policy.mis, x, w.throughput, u, c);
            if (made) test(path, c, k, w.depth, light ? StageId::connect_camera : StageId::connect);
            if (policy.connect_vertices && w.depth + 2 <= policy.max_depth) {
                if (light)
                    path.last = push_vertex<F>(light_vertices,
                                               pack_connection_vertex(x, w.depth, w.d, w.throughput, path.last));
                else
                    path.vertex = {w.d, w.depth, hit.u, hit.v, hit.prim, path.last, w.throughput, x.sums};
            }
        }
        // The last segment of an eye walk can bring emission only, and a path has one more than its light walk.
        if (w.depth + 1 >= policy.max_depth && (light || !policy.counts_last_segment())) return;
        const Vec4f u = random_floats(k, light ? light_scatter_block(w.depth) : scatter_block(w.depth));
        path.tmax = kInfinity;
        path.walking = scatter_walk<F>(policy.mis, x, u, light ? TransportMode::importance : TransportMode::radiance,
                                       policy.rr_depth, w) &&
                       is_light(w.throughput, record(light ? StageId::light_shade : StageId::shade));
    }

    /// The eye vertex and the next vertex of the light walk that is not too far from the light.
    AMBILUX_HD void connect(Path& path) const {
        WaitingVertex& z = path.vertex;
        uint32_t place, light_depth;
        do {
            if (!connecting(path)) return;
            place = z.next;
            const ConnectionVertexFront front = light_vertices.load_front(place);
            light_depth = front.bits.depth();
            z.next = front.link;
        } while (z.depth + light_depth + 1 > policy.max_depth);
        if (!policy.wants(light_depth + 1, z.depth + 1)) return;
        WalkVertex eye = walk_vertex<F>(scene, z.d, z.depth, z.prim, z.u, z.v);
        eye.sums = z.sums;
        const ConnectionVertex light = load_vertex<F>(light_vertices, place);
        WalkConnection c;
        if (!is_zero(light.throughput) &&
            connect_vertices<F>(policy.mis, unpack_vertex<F>(scene, light), light.throughput, eye, z.throughput, c))
            test(path, c, key(path), z.depth + (light_depth << WalkBits::kDepthBits), StageId::connect_vertices);
    }
};

}  // namespace ambilux
