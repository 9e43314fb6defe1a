// Subpaths from the camera and from emitters, and what strategies make of them. `Mis` says which sums travel along a
// subpath and which ratios follow from them: UnidirectionalMis, BidirectionalMis or a model of an integrator's own.
#pragma once

#include "core/rng.h"
#include "transport/bsdf/sample.h"
#include "transport/mis/strategy.h"

namespace ambilux {

/// Where a subpath starts: at the camera or on an emitter.
enum class Side : uint32_t { eye, light };

AMBILUX_HD TransportMode transport_mode(Side side) {
    return side == Side::eye ? TransportMode::radiance : TransportMode::importance;
}

/// Most segments of a subpath that items can count (items/subpath_items.h).
constexpr uint32_t kDepthBits = 14;
constexpr uint32_t kMaxDepth = (1u << kDepthBits) - 1;

/// The next ray of a subpath and what was gathered before it.
template <class Mis>
struct Subpath {
    Vec3f origin, direction;
    Rgb throughput;  ///< eye: importance; light: flux. Everything up to and with the scattering into `direction`
    typename Mis::Sums sums;  ///< of the ray; those of a light subpath begin at its first vertex
    uint32_t depth;           ///< segments, this one included
    float roulette_scale;  ///< roulette sees throughput · scale². Eye: product of the relative indices passed through;
                           ///< light: 1/sqrt of the flux at the start
    bool delta;            ///< the last scattering was a delta (true for first rays)
    [[no_unique_address]] typename Mis::Start start;  ///< of first rays
};

/// What a strategy found, without its weight, and the segment that must be free for it.
template <class Mis>
struct Candidate {
    Rgb value;                  ///< f / p of the strategy
    typename Mis::Ratio ratio;  ///< of the other strategies: weight = 1 / (1 + ratio)
    Strategy strategy;
    Vec3f origin, direction;
    float tmax;
    Vec2f film;        ///< t = 1: where it lands, in pixels of the full film
    bool environment;  ///< `value` lacks the environment's radiance along `direction`, looked up once the way is free
};

/// Random numbers of a subpath: a block of four for each decision (core/rng.h). A model of weights names the type that
/// its integrator uses (Mis::Numbers). It holds these two fields and nothing else, so that whoever needs numbers makes
/// it anew. `Points`: where blocks come from (core/rng.h).
template <class PointsOfBlocks>
struct NumbersFrom {
    using Points = PointsOfBlocks;

    RngKey key;
    uint32_t number = 0;  ///< of the light subpath among those of its key: streaming starts one for every eye vertex

    AMBILUX_HD Vec4f block(uint32_t b) const { return uniform_floats(Points::bits(key, b + (number << 16))); }
    /// Film position and lens.
    AMBILUX_HD Vec4f camera() const { return block(0); }
    /// Place on the emitter; direction, and the lens that sees the place.
    AMBILUX_HD Vec4f emission_position() const { return Points::pick_and_place(block(0)); }
    AMBILUX_HD Vec4f emission_direction() const { return block(1); }
    /// At the vertex at the end of `depth` segments: direction and Russian roulette; emitter (eye); lens (light).
    AMBILUX_HD Vec4f scatter(Side side, uint32_t depth) const {
        return Points::pick_and_place(block(2 * depth - (side == Side::eye ? 1 : 0)));
    }
    AMBILUX_HD Vec4f next_event(uint32_t depth) const { return Points::pick_and_place(block(2 * depth)); }
    /// Emitter i of n, where a vertex samples several: with blocks from `first` on, which nothing else may use.
    AMBILUX_HD Vec4f emitter_of_several(uint32_t first, uint32_t i, uint32_t n) const {
        return Points::pick_and_place(uniform_floats(Points::bits(key, first + (number << 16), i, n)));
    }
    AMBILUX_HD Vec4f lens(uint32_t depth) const { return block(2 * depth + 1); }
    /// Seed of the decisions whether surfaces of partial opacity let a ray pass, another one for every ray: that of the
    /// subpath, and shadow rays, which `which` tells apart.
    AMBILUX_HD uint32_t opacity_seed(uint32_t depth) const { return seed(2 * (depth + (number << kDepthBits))); }
    AMBILUX_HD uint32_t shadow_seed(uint32_t which) const { return seed(2 * which + 1); }

private:
    AMBILUX_HD uint32_t seed(uint32_t which) const {
        const uint32_t word = uint32_t(key.seed) ^ uint32_t(key.seed >> 32) * 0x9e3779b9u ^ uint32_t(key.stream) << 29;
        return hash_word({key.index, key.sample, which, word});
    }
};
using RandomNumbers = NumbersFrom<IndependentPoints>;

template <class Mis>
using NumbersOf = typename Mis::Numbers;

/// Which shadow ray of an eye vertex at `depth` a connection with a light vertex is (RandomNumbers::shadow_seed).
AMBILUX_HD uint32_t connection_ray(uint32_t depth, uint32_t light) { return depth + (light << kDepthBits); }

/// True if `v` can be radiance: finite and not negative.
AMBILUX_HD bool is_valid_radiance(Rgb v) { return is_finite(v) && min_component(v) >= 0.0f; }

}  // namespace ambilux
