// Rays of subpaths and where they end, as queues keep them.
#pragma once

#include "items/packed_sums.h"
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
template <class Mis>
struct PathRayOf {
    using Sums = PackedSums<1, ray_words<typename Mis::Sums>()>;
    static constexpr uint32_t kPairedLanes = 2;
    /// Of camera rays whose far plane has been looked at: throughput 1, and a sum that nobody asks for.
    static constexpr uint32_t kCameraLane = 2;

    Vec3f origin;
    uint32_t path;  ///< slot
    Vec3f direction;
    SubpathBits bits;  ///< depth counts this segment
    Rgb throughput;
    float sum_or_tmax;  ///< word 0 of the sums; of camera rays the distance of the far plane
    typename Sums::More more;
};
using PathRay = PathRayOf<UnidirectionalMis>;

/// A ray of a bidirectional path tracer.
template <class Mis>
struct SubpathRay {
    /// 1: word 3 of the sums lies in the place of tmax, from the second ray on.
    static constexpr uint32_t kLaterWords = later_ray_words<typename Mis::Sums>();
    using Sums = PackedSums<3 + kLaterWords, ray_words<typename Mis::Sums>()>;
    static_assert(std::is_same_v<typename Mis::Start, SubpathStart> && kLaterWords <= 1);
    static constexpr uint32_t kPairedLanes = 4;

    Vec3f origin;
    uint32_t path;
    Vec3f direction;
    SubpathBits bits;
    Rgb throughput;
    float tmax;              ///< of camera rays; of later ones perhaps word 3 of the sums
    float sums_or_start[2];  ///< words 0 and 1 of the sums; first ray of a light subpath, which has no sums yet:
                             ///< SubpathStart::inv_pdf and direction
    uint32_t start;          ///< first rays: camera_distance (eye), prim (light) of SubpathStart
    uint32_t sum_or_start;   ///< word 2 of the sums; first ray of a light subpath: emitter and opacity_step
    typename Sums::More more;
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

/// Where the ray of a slot ended (variant streaming).
struct SlotHit {
    float u, v;
    uint32_t prim;
    uint32_t slot;
};

/// How the subpaths of `Mis` become rays in queues.
template <class Mis, bool kBidirectional = Mis::kBidirectional>
struct SubpathItems;

template <class Mis>
struct SubpathItems<Mis, false> {
    using Path = Subpath<Mis>;
    using Ray = PathRayOf<Mis>;

    /// `tmax`: of a camera ray.
    AMBILUX_HD static Ray pack(const Path& p, Side, uint32_t path, float tmax) {
        const auto sums = Ray::Sums::pack(p.sums);
        return {p.origin,     path,
                p.direction,  SubpathBits::make(p.depth, p.delta, p.roulette_scale),
                p.throughput, p.depth == 1 ? tmax : sums.word[0],
                sums.more};
    }
    AMBILUX_HD static Path unpack(const Ray& r) {
        const typename Ray::Sums sums = {{r.sum_or_tmax}, r.more};
        return {r.origin,       r.direction,
                r.throughput,   sums.template unpack<typename Mis::Sums>(),
                r.bits.depth(), r.bits.roulette_scale(),
                r.bits.delta(), {}};
    }
    AMBILUX_HD static float tmax(const Ray& r) { return r.bits.depth() == 1 ? r.sum_or_tmax : kInfinity; }
};

template <class Mis>
struct SubpathItems<Mis, true> {
    using Path = Subpath<Mis>;
    using Ray = SubpathRay<Mis>;

    AMBILUX_HD static Ray pack(const Path& p, Side side, uint32_t path, float tmax) {
        const auto sums = Ray::Sums::pack(p.sums);
        Ray r = {p.origin,
                 path,
                 p.direction,
                 SubpathBits::make(p.depth, p.delta, p.roulette_scale),
                 p.throughput,
                 tmax,
                 {sums.word[0], sums.word[1]},
                 0,
                 float_bits(sums.word[2]),
                 sums.more};
        if constexpr (Ray::kLaterWords > 0)
            if (p.depth > 1) r.tmax = sums.word[3];
        if (p.depth == 1 && side == Side::light) {
            r.sums_or_start[0] = p.start.inv_pdf;
            r.sums_or_start[1] = p.start.direction;
            r.start = p.start.prim;
            r.sum_or_start = p.start.emitter | p.start.opacity_step << kTicketBits;
        } else if (p.depth == 1) {
            r.start = float_bits(p.start.camera_distance);
        }
        return r;
    }
    AMBILUX_HD static Path unpack(const Ray& r) {
        typename Ray::Sums sums = {{r.sums_or_start[0], r.sums_or_start[1], bits_float(r.sum_or_start)}, r.more};
        if constexpr (Ray::kLaterWords > 0) sums.word[3] = r.bits.depth() > 1 ? r.tmax : 0.0f;
        Path p{};
        p.origin = r.origin;
        p.direction = r.direction;
        p.throughput = r.throughput;
        p.sums = sums.template unpack<typename Mis::Sums>();
        p.start = {r.sums_or_start[0],
                   r.sums_or_start[1],
                   r.start,
                   r.sum_or_start & (kTickets - 1),
                   r.sum_or_start >> kTicketBits,
                   bits_float(r.start)};
        p.depth = r.bits.depth();
        p.roulette_scale = r.bits.roulette_scale();
        p.delta = r.bits.delta();
        return p;
    }
    AMBILUX_HD static float tmax(const Ray& r) { return r.bits.depth() == 1 ? r.tmax : kInfinity; }
};

// A third sum has a place in a ray; docs/architecture.md lists the words that are free.
static_assert(sizeof(PathRay) == 3 * 16 && sizeof(PathHit) == 4 * 16);
static_assert(sizeof(SubpathRay<BidirectionalMis>) == 4 * 16 &&
              sizeof(HitItem<SubpathRay<BidirectionalMis>>) == 5 * 16);

}  // namespace ambilux
