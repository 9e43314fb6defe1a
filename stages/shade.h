// shade: a hit gives light, asks for a connection and goes on.
#pragma once

#include "items/path_items.h"
#include "queues/wave.h"
#include "stages/connect.h"
#include "stages/path_policy.h"
#include "stages/stage.h"
#include "transport/emitter.h"
#include "transport/surface_scattering.h"

namespace ambilux {

/// Probability with which a walk of `throughput` goes on (Mitsuba's rule: radiance is scaled by the squared index of
/// the medium, which is not loss).
AMBILUX_HD float survival_probability(Rgb throughput, float eta_scale) {
    return min(max_component(throughput) * sqr(eta_scale), 0.95f);
}

template <Features F>
struct Shade {
    static constexpr bool kGathers =
        !F.several_bsdfs() && !F.has_environment();  ///< hits are in no order, and misses of no use
    static constexpr uint32_t kBlocksPerSm =
        F.bsdfs == bit(BsdfType::diffuse) ? 6
        : F.textures                      ? 4
                     : 5;  ///< 80, 128 or 102 registers; fewer spill too much (docs/performance.md)

    SceneView scene;
    Wave wave;
    PathPolicy policy;
    Queue<HitItem> hits;
    HitOutlet candidates;
    Queue<ConnectItem> connections;
    Queue<RayItem> rays;
    StageRecord* record;
    Connect<F> connect;

    /// True if nothing comes of rays that meet nothing.
    AMBILUX_HD bool skips_misses() const {
        return !F.has_environment() || scene.environment == kNone || !policy.count_hits;
    }

    AMBILUX_HD void operator()(uint32_t i) const {
        RayItem next;
        if (take(hit(i), next)) rays.push(next);
    }

    /// Hits of camera rays, the only ones while depth is 1, are not kept whole on a device.
    AMBILUX_HD HitItem hit(uint32_t i) const {
#if defined(__CUDA_ARCH__)
        constexpr uint32_t kOne = 0x3f800000u;
        return hits.load_but(i, wave.state->depth == 1 ? RayItem::kKnownLane : hits.kLanes, {{kOne, kOne, kOne, kOne}});
#else
        return hits.load(i);
#endif
    }

    /// True if the walk goes on with the ray `next`.
    AMBILUX_HD bool take(const HitItem& h, RayItem& next) const {
        if (h.prim == kNone) {
            if (wants_emission(h))
                emit(h, environment_radiance<F>(scene, h.d),
                     can_sample(h) ? pdf_environment_direct<F>(scene, h.d) : 0.0f);
            return false;
        }
        const SurfacePoint point = surface_at<F>(scene, h.prim, h.u, h.v);
        const uint32_t emitter = scene.shapes[point.shape].emitter;
        if (emitter != kNone && wants_emission(h)) {
            const Rgb radiance = emitted_radiance<F>(scene, emitter, point, -h.d);
            if (!is_zero(radiance))
                emit(h, radiance, can_sample(h) ? pdf_emitter_direct<F>(scene, emitter, h.o, h.d, point) : 0.0f);
        }

        const uint32_t depth = h.bits.depth();
        if (depth >= policy.max_depth) return false;
        const Scattering s = make_scattering<F>(scene, point, -h.d);
        const RngKey key = wave.key(h.path);
        if (policy.connect && bsdf_is_smooth(s.bsdf)) {
            if (policy.connect_in_shade)
                connect.take(point, s, -h.d, key, h.path, depth, h.throughput);
            else
                connections.push({h.d, h.path, h.throughput, h.bits, h.u, h.v, h.prim, 0});
        }
        return scatter(h, point, s, key, depth, next);
    }

private:
    AMBILUX_HD bool wants_emission(const HitItem& h) const {
        return policy.count_hits && !(policy.hide_emitters && h.bits.depth() == 1);
    }

    /// True if sampling emitters at the previous vertex could have found this light too.
    AMBILUX_HD bool can_sample(const HitItem& h) const { return policy.connect && !h.bits.delta(); }

    AMBILUX_HD void emit(const HitItem& h, Rgb radiance, float pdf_other) const {
        if (policy.estimator == Estimator::nee && pdf_other > 0.0f) return;  // found by the connection
        const Rgb value = h.throughput * radiance;
        if (is_light(value, record) && !is_zero(value)) candidates.push({value, h.path, h.pdf_sa, pdf_other, {}, 0});
    }

    AMBILUX_HD bool scatter(const HitItem& h, const SurfacePoint& point, const Scattering& s, const RngKey& key,
                            uint32_t depth, RayItem& next) const {
        const Vec4f u = random_floats(key, scatter_block(depth));
        ScatterSample sample;
        if (!scatter_sample<F>(s, {u.x, u.y, u.z}, TransportMode::radiance, sample)) return false;
        const bool delta = sample.flags & kScatterDelta;
        // The last segment can bring emission only.
        if (depth + 1 == policy.max_depth && (!policy.count_hits || (policy.estimator == Estimator::nee && !delta)))
            return false;
        Rgb throughput = h.throughput * sample.weight;
        if (!is_light(throughput, record) || is_zero(throughput)) return false;
        const float eta_scale = h.bits.eta_scale() * sample.eta;
        if (depth >= policy.rr_depth) {
            const float survival = survival_probability(throughput, eta_scale);
            if (!(u.w < survival)) return false;
            throughput = throughput / survival;
        }
        const Vec3f o = offset_ray_origin(point.p, point.p_error, point.ng, sample.wo);
        next = {o, h.path, sample.wo, WalkBits::make(depth + 1, delta, eta_scale), throughput, sample.pdf_sa};
        return true;
    }
};

}  // namespace ambilux
