// What travels through the queues of a path tracer.
#pragma once

#include "queues/queue.h"
#include "scene/ray.h"
#include "stages/techniques.h"

namespace ambilux {

/// What an eye walk remembers in 32 bits: depth (segments; 14 bits), whether the last scattering was a delta, and the
/// product of relative indices passed, which only Russian roulette reads (16 bits of a float are enough for a
/// probability that any value keeps unbiased).
struct WalkBits {
    uint32_t bits;

    static constexpr uint32_t kDepthBits = 14;
    static constexpr uint32_t kMaxDepth = (1u << kDepthBits) - 1;

    AMBILUX_HD static WalkBits make(uint32_t depth, bool delta, float eta_scale) {
        return {depth | (delta ? 1u << kDepthBits : 0u) | (float_bits(eta_scale) & 0xffff0000u)};
    }
    AMBILUX_HD uint32_t depth() const { return bits & kMaxDepth; }
    AMBILUX_HD bool delta() const { return bits >> kDepthBits & 1u; }
    AMBILUX_HD float eta_scale() const { return bits_float(bits & 0xffff0000u); }
};
static_assert(WalkBits::kDepthBits + 1 <= 16, "depth and flag share the lower half of a word");

/// A ray of an eye walk, to be extended to the next surface.
struct RayItem {
    static constexpr uint32_t kPairedLanes = 2;
    static constexpr uint32_t kKnownLane =
        2;  ///< of camera rays whose distances have been looked at: throughput 1, and a density that nobody asks for

    Vec3f o;
    uint32_t path;  ///< slot
    Vec3f d;
    WalkBits bits;  ///< depth counts this segment
    Rgb throughput;
    float pdf_sa;  ///< of d, by BSDF sampling; after a delta a probability. Camera rays: distance of the far plane
};

/// Where a ray of a walk ended: the last lane of HitItem and WalkHit.
struct HitEnd {
    float u, v;
    uint32_t prim;
    uint32_t pad;
};

/// Where that ray ended; `prim == kNone`: nowhere, only the environment remains. Its first lanes are the RayItem.
struct HitItem {
    static constexpr uint32_t kPairedLanes = 2;

    Vec3f o;
    uint32_t path;
    Vec3f d;
    WalkBits bits;
    Rgb throughput;
    float pdf_sa;
    float u, v;
    uint32_t prim;
    uint32_t pad;
};

AMBILUX_HD HitItem hit_of(const RayItem& r, const Hit& hit) {
    return {r.o, r.path, r.d, r.bits, r.throughput, r.pdf_sa, hit.u, hit.v, hit.prim, 0};
}

/// A vertex to be connected to an emitter.
struct ConnectItem {
    Vec3f d;  ///< of the ray that found it
    uint32_t path;
    Rgb throughput;
    WalkBits bits;
    float u, v;
    uint32_t prim;
    uint32_t pad;
};

/// Light found by a hit, before it is weighted.
struct HitCandidate {
    Rgb value;
    uint32_t path;
    float pdf_this, pdf_other;  ///< densities of BSDF sampling and of emitter sampling; pdf_other is 0 when only hits
                                ///< can find this light
    Strategy strategy;          ///< bidirectional methods
    uint32_t pad;
};

/// `tmax` of a ray towards the environment: its value lacks the radiance, which is looked up only if the way is free.
constexpr float kTowardsEnvironment = -kInfinity;

/// Light sampled at an emitter, before it is weighted, and the ray that must be free.
struct ConnectCandidate {
    Rgb value;
    uint32_t path;
    float pdf_this, pdf_other;  ///< densities of emitter sampling and of BSDF sampling; pdf_other is 0 when only
                                ///< emitter sampling can find this light
    uint32_t alpha_seed;
    float tmax;  ///< or kTowardsEnvironment
    Vec3f o;
    Strategy strategy;  ///< bidirectional methods
    Vec3f d;
    uint32_t pad;
};

/// A ray towards an emitter and what it is worth if it is free.
struct ShadowItem {
    Rgb value;
    uint32_t path;
    Vec3f o;
    float tmax;  ///< or kTowardsEnvironment
    Vec3f d;
    uint32_t alpha_seed;
};

/// Light to be added to a path's sample.
struct alignas(16) Contribution {
    Rgb value;
    uint32_t path;
};

}  // namespace ambilux
