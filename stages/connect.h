// connect: a vertex samples an emitter (next event estimation).
#pragma once

#include "items/path_items.h"
#include "queues/wave.h"
#include "stages/mis_weight.h"
#include "stages/path_policy.h"
#include "stages/stage.h"
#include "transport/emitter.h"
#include "transport/surface_scattering.h"

namespace ambilux {

template <Features F>
struct Connect {
    SceneView scene;
    Wave wave;
    PathPolicy policy;
    Queue<ConnectItem> connections;
    ConnectOutlet candidates;
    StageRecord* record;

    /// What operator() will wait for, so that an executor can ask for it some items ahead.
    AMBILUX_HD const void* far_memory(uint32_t i) const {
        if constexpr (!F.has(EmitterType::envmap)) return nullptr;
        const ConnectItem c = connections.load(i);
        return emitter_sample_memory<F>(scene, random_floats(wave.key(c.path), emitter_block(c.bits.depth())));
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        const ConnectItem c = connections.load(i);
        const SurfacePoint point = surface_at<F>(scene, c.prim, c.u, c.v);
        const RngKey key = wave.key(c.path);
        EmitterSample light;
        if (!sample(point, -c.d, key, c.bits.depth(), light)) return;
        finish(point, make_scattering<F>(scene, point, -c.d), light, key, c.path, c.bits.depth(), c.throughput);
    }

    /// The same for a vertex whose BSDF and random numbers are known already.
    AMBILUX_HD void take(const SurfacePoint& point, const Scattering& s, Vec3f wo, const RngKey& key, uint32_t path,
                         uint32_t depth, Rgb throughput) const {
        EmitterSample light;
        if (sample(point, wo, key, depth, light)) finish(point, s, light, key, path, depth, throughput);
    }

private:
    AMBILUX_HD bool sample(const SurfacePoint& point, Vec3f wo, const RngKey& key, uint32_t depth,
                           EmitterSample& light) const {
        return sample_emitter_deferred<F>(scene, point.p, random_floats(key, emitter_block(depth)), light) &&
               may_scatter(scene, point, wo, light.wi);
    }

    AMBILUX_HD void finish(const SurfacePoint& point, const Scattering& s, const EmitterSample& light,
                           const RngKey& key, uint32_t path, uint32_t depth, Rgb throughput) const {
        const BsdfValue f = scatter_evaluate<F>(s, light.wi, TransportMode::radiance);
        if (is_zero(f.value)) return;
        const bool environment = is_environment<F>(scene, light.emitter);
        const Rgb value = throughput * f.value * ((environment ? splat(1.0f) : light.radiance) / light.pdf_sa);
        if (!is_light(value, record) || is_zero(value)) return;
        // Only BSDF sampling and a hit could find this light too.
        const bool other = policy.estimator == Estimator::mis && !light.delta;

        ConnectCandidate out = {value,
                                path,
                                light.pdf_sa,
                                other ? f.pdf_sa : 0.0f,
                                0,
                                environment ? kTowardsEnvironment : kInfinity,
                                {},
                                {},
                                light.wi,
                                0};
        out.o = offset_ray_origin(point.p, point.p_error, point.ng, light.wi);
        if (light.distance < kInfinity) {
            // Both ends are moved off their surfaces by their error, so the segment between them is open at either end.
            const Vec3f to = offset_ray_origin(light.p, light.p_error, light.ng, -light.wi) - out.o;
            const float distance = length(to);
            if (!(distance > 0.0f)) return;
            out.d = to / distance;
            out.tmax = distance * (1.0f - gamma_bound(8));
        }
        if (F.opacity || policy.cull > 0.0f) out.alpha_seed = alpha_seed(key, depth, true);
        candidates.push(out);
    }
};

}  // namespace ambilux
