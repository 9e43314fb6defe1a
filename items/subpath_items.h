// Rays of subpaths and where they end, as queues keep them.
#pragma once

#include "scene/ray.h"
#include "transport/mis/bidirectional.h"
#include "transport/mis/unidirectional.h"

namespace ambilux {

/// Depth (kDepthBits), whether the last scattering was a delta (1 bit), and Subpath::roulette_scale (the upper 16 bits
/// of a float, rounded_scale). All exactly.
struct SubpathBits {
    uint32_t bits;

    AMBILUX_HD static SubpathBits make(uint32_t depth, bool delta, float roulette_scale) {
        return {depth | (delta ? 1u << kDepthBits : 0u) | (float_bits(roulette_scale) & 0xffff0000u)};
    }
    AMBILUX_HD uint32_t depth() const { return bits & kMaxDepth; }
    AMBILUX_HD bool delta() const { return bits >> kDepthBits & 1u; }
    AMBILUX_HD float roulette_scale() const { return bits_float(bits & 0xffff0000u); }
};
static_assert(kDepthBits + 1 <= 16, "depth and flag share the lower half of a word");

/// A ray of a path tracer.
struct PathRay {
    static constexpr uint32_t kPairedLanes = 2;
    /// Of camera rays whose far plane has been looked at: throughput 1, and a density that nobody asks for.
    static constexpr uint32_t kCameraLane = 2;

    Vec3f origin;
    uint32_t path;  ///< slot
    Vec3f direction;
    SubpathBits bits;  ///< depth counts this segment
    Rgb throughput;
    float pdf_sa_or_tmax;  ///< density of the direction by BSDF sampling; of camera rays the distance of the far plane
};

/// A ray of a bidirectional path tracer.
struct SubpathRay {
    static constexpr uint32_t kPairedLanes = 4;

    Vec3f origin;
    uint32_t path;
    Vec3f direction;
    SubpathBits bits;
    Rgb throughput;
    float tmax;              ///< of camera rays
    float sums_or_start[2];  ///< MisSums; first ray of a light subpath: SubpathStart::inv_pdf and direction
    uint32_t start[2];       ///< first rays: camera_distance (eye), prim, emitter and opacity (light) of SubpathStart
};

/// Where a ray ended: the last lane of a HitItem.
struct HitEnd {
    float u, v;
    uint32_t prim;
    uint32_t pad;
};

/// A ray and where it ended; a miss if `prim` is kNone.
template <class Ray>
struct HitItem {
    static constexpr uint32_t kPairedLanes = Ray::kPairedLanes;

    Ray ray;
    float u, v;
    uint32_t prim;
    uint32_t pad;

    AMBILUX_HD Hit hit() const { return {0.0f, u, v, prim}; }
};
using PathHit = HitItem<PathRay>;
using SubpathHit = HitItem<SubpathRay>;

/// Where the ray of a slot ended (variant streaming).
struct SlotHit {
    float u, v;
    uint32_t prim;
    uint32_t slot;
};

/// The items of a subpath that carries the sums of `Mis`.
template <class Mis>
struct SubpathItems;

template <>
struct SubpathItems<UnidirectionalMis> {
    using Path = Subpath<UnidirectionalMis>;
    using Ray = PathRay;

    /// `tmax`: of a camera ray.
    AMBILUX_HD static Ray pack(const Path& p, Side, uint32_t path, float tmax) {
        return {p.origin,     path,
                p.direction,  SubpathBits::make(p.depth, p.delta, p.roulette_scale),
                p.throughput, p.depth == 1 ? tmax : p.sums.pdf_sa};
    }
    AMBILUX_HD static Path unpack(const Ray& r) {
        return {
            r.origin,      r.direction, r.throughput, {r.pdf_sa_or_tmax}, {}, r.bits.depth(), r.bits.roulette_scale(),
            r.bits.delta()};
    }
    AMBILUX_HD static float tmax(const Ray& r) { return r.bits.depth() == 1 ? r.pdf_sa_or_tmax : kInfinity; }
};

template <>
struct SubpathItems<BidirectionalMis> {
    using Path = Subpath<BidirectionalMis>;
    using Ray = SubpathRay;

    AMBILUX_HD static Ray pack(const Path& p, Side side, uint32_t path, float tmax) {
        Ray r = {p.origin,
                 path,
                 p.direction,
                 SubpathBits::make(p.depth, p.delta, p.roulette_scale),
                 p.throughput,
                 tmax,
                 {p.sums.dvcm, p.sums.dvc},
                 {0, 0}};
        if (p.depth == 1 && side == Side::light) {
            r.sums_or_start[0] = p.start.inv_pdf;
            r.sums_or_start[1] = p.start.direction;
            r.start[0] = p.start.prim;
            r.start[1] = p.start.emitter | p.start.opacity_step << kTicketBits;
        } else if (p.depth == 1) {
            r.start[0] = float_bits(p.start.camera_distance);
        }
        return r;
    }
    AMBILUX_HD static Path unpack(const Ray& r) {
        Path p{};
        p.origin = r.origin;
        p.direction = r.direction;
        p.throughput = r.throughput;
        p.sums = {r.sums_or_start[0], r.sums_or_start[1]};
        p.start = {r.sums_or_start[0],          r.sums_or_start[1],        r.start[0],
                   r.start[1] & (kTickets - 1), r.start[1] >> kTicketBits, bits_float(r.start[0])};
        p.depth = r.bits.depth();
        p.roulette_scale = r.bits.roulette_scale();
        p.delta = r.bits.delta();
        return p;
    }
    AMBILUX_HD static float tmax(const Ray& r) { return r.bits.depth() == 1 ? r.tmax : kInfinity; }
};

}  // namespace ambilux
