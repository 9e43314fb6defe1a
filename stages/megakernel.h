// megakernel: one thread does a slot's light walk, its eye walk and all connections, with the functions that the stages use.
#pragma once

#include "stages/bidirectional_policy.h"
#include "stages/generate.h"
#include "stages/splat.h"
#include "stages/stage.h"
#include "stages/walk_items.h"

namespace ambilux {

template <Features F, class Tracer>
struct Megakernel {
    SceneView scene;
    Tracer tracer;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<VertexItem> light_vertices;  ///< memory for the vertices of all light walks; used through chains, never as a queue
    Queue<SplatItem> splats;
    Lane* samples;
    StageRecord* records;  ///< one per StageId: rays are counted where the stages would

    AMBILUX_HD void operator()(uint32_t slot) const {
        samples[slot] = {};
        const PathSlot p = wave.locate(slot);
        if (!p.active || policy.max_depth == 0) return;
        Counts counts{};
        const uint32_t last = policy.light_walks ? light_walk(slot, p, counts) : kNone;
        const Rgb value = eye_walk(p, last, counts);
        memcpy(&samples[slot], &value, sizeof(value));
        add(StageId::light_extend, counts.light_rays);
        add(StageId::extend, counts.eye_rays);
        add(StageId::occlude, counts.shadow_rays);
    }

private:
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

    // Traversal appears once for either kind of ray, not at every call: the kernel is larger than the instruction caches as it is.

    /// The weighted value of a connection if its ray is free, else zero.
    __attribute__((noinline)) AMBILUX_HD Rgb visible(WalkConnection c, const RngKey& key, uint32_t which, StageId maker, Counts& counts) const {
        const Rgb none = {0.0f, 0.0f, 0.0f};
        if (!is_light(c.value, record(maker))) return none;
        c.value *= 1.0f / (1.0f + c.others);
        if (!is_light(c.value, record(StageId::mis_weight)) || is_zero(c.value)) return none;
        Ray ray = {c.o, c.tmax, c.d, 0};
        if constexpr (F.opacity) ray.alpha_seed = alpha_seed(key, which, true);
        ++counts.shadow_rays;
        return tracer.template occluded<F>(scene, ray) ? none : c.value;
    }

    AMBILUX_HD void push_splat(WalkConnection c, Vec2f film, uint32_t slot, const RngKey& key, uint32_t depth, StageId maker, Counts& counts) const {
        const Rgb value = visible(c, key, depth, maker, counts);
        if (!is_zero(value)) splats.push({value, slot, film, {}, 0.0f});
    }

    /// The nearest hit of the walk's ray; false if there is none.
    __attribute__((noinline)) AMBILUX_HD bool extend(const Walk& w, const RngKey& key, float tmax, Hit& hit) const {
        Ray ray = {w.o, tmax, w.d, 0};
        if constexpr (F.opacity) ray.alpha_seed = alpha_seed(key, w.depth, false);
        return tracer.template closest<F>(scene, ray, hit);
    }

    /// Returns the place of the last vertex kept.
    AMBILUX_HD uint32_t light_walk(uint32_t slot, const PathSlot& p, Counts& counts) const {
        const RngKey key = wave.key(p, Stream::light);
        const Vec4f direction = random_floats(key, kEmissionBlock + 1);
        uint32_t last = kNone;
        EmissionSample e;
        if (!sample_emission<F>(scene, random_floats(key, kEmissionBlock), {direction.x, direction.y}, e)) return last;
        Walk w = start_light_walk(e);
        if (!is_light(w.throughput, record(StageId::light_generate))) return last;
        WalkConnection c;
        Vec2f film;
        if (policy.splat && !policy.hide_emitters && connect_visible_light<F>(scene, policy.mis, e, {direction.z, direction.w}, c, film))
            push_splat(c, film, slot, key, 0, StageId::light_generate, counts);
        if (policy.max_depth < 2) return last;
        for (;;) {
            Hit hit;
            ++counts.light_rays;
            if (!extend(w, key, kInfinity, hit)) return last;
            const WalkVertex y = light_vertex<F>(scene, policy.mis, w, hit.prim, hit.u, hit.v);
            if (bsdf_is_smooth(y.scattering.bsdf)) {
                if (policy.splat) {
                    const Vec4f u = random_floats(key, lens_block(w.depth));
                    if (connect_camera<F>(scene, policy.mis, y, w.throughput, {u.x, u.y}, c, film)) push_splat(c, film, slot, key, w.depth, StageId::connect_camera, counts);
                }
                if (policy.connect_vertices && w.depth + 2 <= policy.max_depth)
                    last = light_vertices.push({w.d, slot, w.throughput, WalkBits::make(w.depth, w.delta, w.eta_scale), hit.u, hit.v, hit.prim, y.sums.dvcm, y.sums.dvc, last, {0, 0}});
            }
            if (w.depth + 1 >= policy.max_depth) return last;
            const Vec4f u = random_floats(key, light_scatter_block(w.depth));
            if (!scatter_walk<F>(policy.mis, y, u, TransportMode::importance, policy.rr_depth, w)) return last;
            if (!is_light(w.throughput, record(StageId::light_shade))) return last;
        }
    }

    AMBILUX_HD Rgb emitted(const Walk& w, Rgb radiance, float others) const {
        const Rgb value = w.throughput * radiance;
        if (!is_light(value, record(StageId::shade)) || is_zero(value)) return {0.0f, 0.0f, 0.0f};
        const Rgb weighted = value * (1.0f / (1.0f + others));
        return is_light(weighted, record(StageId::mis_weight)) ? weighted : Rgb{0.0f, 0.0f, 0.0f};
    }

    AMBILUX_HD Rgb eye_walk(const PathSlot& p, uint32_t last, Counts& counts) const {
        const RngKey key = wave.key(p);
        const CameraSample camera = camera_sample(scene, wave, p);
        Walk w = start_eye_walk(scene, policy.mis, camera);
        Rgb sum = {0.0f, 0.0f, 0.0f};
        for (;;) {
            const bool shown = !(policy.hide_emitters && w.depth == 1);
            Hit hit;
            ++counts.eye_rays;
            if (!extend(w, key, w.depth == 1 ? camera.tmax : kInfinity, hit)) {
                if (F.has_environment() && policy.count_environment && shown)
                    sum += emitted(w, environment_radiance<F>(scene, w.d), others_of_escape<F>(scene, policy.mis, w.sums, w.depth, w.d));
                return sum;
            }
            if (policy.background_only) return sum;
            const WalkVertex z = eye_vertex<F>(scene, policy.mis, w, hit.prim, hit.u, hit.v);
            const uint32_t emitter = scene.shapes[z.point.shape].emitter;
            if (policy.count_hits && shown && emitter != kNone) {
                const Rgb radiance = emitted_radiance<F>(scene, emitter, z.point, -w.d);
                if (!is_zero(radiance)) sum += emitted(w, radiance, others_of_hit<F>(scene, policy.mis, w.sums, w.depth, emitter, w.o, w.d, w.start_distance, z.point));
            }
            if (w.depth >= policy.max_depth) return sum;
            if (bsdf_is_smooth(z.scattering.bsdf)) sum += connections(z, w, key, last, counts);
            if (w.depth + 1 == policy.max_depth && !policy.count_hits && !policy.count_environment) return sum;
            const Vec4f u = random_floats(key, scatter_block(w.depth));
            if (!scatter_walk<F>(policy.mis, z, u, TransportMode::radiance, policy.rr_depth, w)) return sum;
            if (!is_light(w.throughput, record(StageId::shade))) return sum;
        }
    }

    __attribute__((noinline)) AMBILUX_HD Rgb connections(const WalkVertex& z, const Walk& w, const RngKey& key, uint32_t last, Counts& counts) const {
        Rgb sum = {0.0f, 0.0f, 0.0f};
        WalkConnection c;
        if (policy.next_event && connect_next_event<F>(scene, policy.mis, z, w.throughput, random_floats(key, emitter_block(w.depth)), c))
            sum += visible(c, key, w.depth, StageId::connect, counts);
        // A vertex past the capacity was not kept: the wave will be done again.
        for (uint32_t i = last; i < light_vertices.capacity;) {
            const VertexItem light = light_vertices.load(i);
            i = light.previous;
            if (w.depth + light.bits.depth() + 1 > policy.max_depth) continue;
            const WalkVertex y = unpack_vertex<F>(scene, light);
            if (connect_vertices<F>(policy.mis, y, light.throughput, z, w.throughput, c))
                sum += visible(c, key, w.depth + (light.bits.depth() << WalkBits::kDepthBits), StageId::connect_vertices, counts);
        }
        return sum;
    }
};

}  // namespace ambilux
