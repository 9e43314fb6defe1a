// Shuffled, Owen-scrambled Sobol' points (Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4)): numbers as
// pure functions of what names them, as those of core/rng.h, that fill the unit cube of four dimensions more evenly.
#pragma once

#include <array>
#include <utility>

#include "core/rng.h"

namespace ambilux {

constexpr uint32_t kSobolDimensions = 4;

AMBILUX_HD constexpr uint32_t reversed_bits(uint32_t x) {
    x = (x & 0x55555555u) << 1 | (x >> 1 & 0x55555555u);
    x = (x & 0x33333333u) << 2 | (x >> 2 & 0x33333333u);
    x = (x & 0x0f0f0f0fu) << 4 | (x >> 4 & 0x0f0f0f0fu);
    x = (x & 0x00ff00ffu) << 8 | (x >> 8 & 0x00ff00ffu);
    return x << 16 | x >> 16;
}

/// Direction numbers of a dimension from the second on: v_bit, where bit `bit` of a point's index adds v_bit to its
/// coordinate. Primitive polynomials and first numbers of Joe and Kuo 2008, "Constructing Sobol Sequences with Better
/// Two-Dimensional Projections" (new-joe-kuo-6.21201).
constexpr std::array<uint32_t, 32> sobol_directions(uint32_t dimension) {
    struct {
        uint32_t degree, coefficients, first[3];
    } constexpr kPublished[] = {{1, 0, {1}}, {2, 1, {1, 3}}, {3, 1, {1, 3, 1}}};
    const auto& d = kPublished[dimension - 1];
    std::array<uint32_t, 32> v{};
    for (uint32_t i = 0; i < 32; ++i) {
        if (i < d.degree) {
            v[i] = d.first[i] << (31 - i);
            continue;
        }
        v[i] = v[i - d.degree] ^ v[i - d.degree] >> d.degree;
        for (uint32_t k = 1; k < d.degree; ++k)
            if (d.coefficients >> (d.degree - 1 - k) & 1u) v[i] ^= v[i - k];
    }
    return v;
}

namespace detail {

template <uint32_t kDimension, uint32_t kBit>
constexpr uint32_t kReversedDirection = reversed_bits(sobol_directions(kDimension)[kBit]);

/// A coordinate of the point of this index, its bits reversed.
template <uint32_t kDimension, uint32_t... kBits>
AMBILUX_HD uint32_t reversed_sobol(uint32_t index, std::integer_sequence<uint32_t, kBits...>) {
    // Masks and not conditions: a host adds them up as vectors.
    return (((0u - (index >> kBits & 1u)) &
             std::integral_constant<uint32_t, kReversedDirection<kDimension, kBits>>::value) ^
            ...);
}
template <uint32_t kDimension>
AMBILUX_HD uint32_t reversed_sobol(uint32_t index) {
    if constexpr (kDimension == 0)
        return index;
    else
        return reversed_sobol<kDimension>(index, std::make_integer_sequence<uint32_t, 32>());
}

/// A permutation in which a bit is flipped or not as the bits below it and the seed say: of the type of Laine and
/// Karras 2011, with the constants of Burley 2020 (listing 3).
AMBILUX_HD uint32_t flip_by_lower_bits(uint32_t x, uint32_t seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

}  // namespace detail

/// Nested uniform scrambling (Owen 1995): a bit is flipped or not as the bits above it and the seed say, so that
/// aligned intervals of 2^m become aligned intervals of 2^m. Over uniform seeds the result is uniform.
AMBILUX_HD uint32_t owen_scrambled(uint32_t x, uint32_t seed) {
    return reversed_bits(detail::flip_by_lower_bits(reversed_bits(x), seed));
}

/// Coordinates of the Sobol' point of this index, in units of 2^-32.
AMBILUX_HD Uint4 sobol_point(uint32_t index) {
    return {reversed_bits(detail::reversed_sobol<0>(index)), reversed_bits(detail::reversed_sobol<1>(index)),
            reversed_bits(detail::reversed_sobol<2>(index)), reversed_bits(detail::reversed_sobol<3>(index))};
}

/// The same scrambled: `shuffle` says which points aligned intervals of indices get, and `seeds` scramble coordinates.
AMBILUX_HD Uint4 scrambled_sobol_point(uint32_t index, uint32_t shuffle, const Uint4& seeds) {
    const uint32_t i = owen_scrambled(index, shuffle);
    return {reversed_bits(detail::flip_by_lower_bits(detail::reversed_sobol<0>(i), seeds.x)),
            reversed_bits(detail::flip_by_lower_bits(detail::reversed_sobol<1>(i), seeds.y)),
            reversed_bits(detail::flip_by_lower_bits(detail::reversed_sobol<2>(i), seeds.z)),
            reversed_bits(detail::flip_by_lower_bits(detail::reversed_sobol<3>(i), seeds.w))};
}

/// The key of a light subpath for SobolPoints: all those of a render are points of one set, whatever their sample.
/// `number`: of the subpath in the render. A set has 2^32 points; the next has other scrambles.
AMBILUX_HD RngKey light_point_key(uint64_t seed, uint64_t number) {
    return {seed, uint32_t(number), uint32_t(number >> 32), Stream::light};
}

/// What IndependentPoints (core/rng.h) is, of Sobol' points. Every block has scrambles of its own. Points of one set
/// are the samples of a pixel or, of Stream::light (light_point_key), the light subpaths of the film.
struct SobolPoints {
    AMBILUX_HD static Uint4 bits(const RngKey& key, uint32_t block, uint32_t i = 0, uint32_t n = 1) {
        const bool light = key.stream == Stream::light;
        const uint64_t index = uint64_t(light ? key.index : key.sample) * n + i;
        // Of the set, by a sample that no independent numbers have.
        const RngKey set = {key.seed, light ? key.sample : key.index, ~uint32_t(index >> 32), key.stream};
        const Uint4 seeds = random_bits(set, block);
        return scrambled_sobol_point(uint32_t(index), hash_word(seeds), seeds);
    }
    /// Decisions take the first number to pick and the two behind it for a place or a direction: these two get the pair
    /// of dimensions that is the most even.
    AMBILUX_HD static Vec4f pick_and_place(Vec4f u) { return {u.z, u.x, u.y, u.w}; }
};

/// The key of the same sequence as points of a set.
AMBILUX_HD RngKey of_point_set(RngKey key) {
    key.stream = Stream(uint32_t(key.stream) | kOfPointSet);
    return key;
}

/// Sobol' points where the key says so, independent ones elsewhere.
struct ChosenPoints {
    AMBILUX_HD static Uint4 bits(RngKey key, uint32_t block, uint32_t i = 0, uint32_t n = 1) {
        if (!(uint32_t(key.stream) & kOfPointSet)) return IndependentPoints::bits(key, block, i, n);
        key.stream = Stream(uint32_t(key.stream) & ~kOfPointSet);
        return SobolPoints::bits(key, block, i, n);
    }
    AMBILUX_HD static Vec4f pick_and_place(Vec4f u) { return SobolPoints::pick_and_place(u); }
};

}  // namespace ambilux
