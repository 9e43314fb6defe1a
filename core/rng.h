// Counter-based random numbers: a value is a pure function of (seed, index, sample, stream, block).
#pragma once

#include "core/math.h"

namespace ambilux {

/// Which subpath a number belongs to; light subpaths of the same index never share numbers with eye subpaths.
enum class Stream : uint32_t { eye = 0, light = 1, bench = 2, test = 3, pilot = 4 };

/// Bit of a stream whose numbers are points of a set, for ChosenPoints (core/sobol.h).
constexpr uint32_t kOfPointSet = 8;

/// Names a sequence of random blocks. `index`: pixel or light path; `sample`: sample of that pixel.
struct RngKey {
    uint64_t seed;
    uint32_t index;
    uint32_t sample;
    Stream stream;
};

struct Uint4 {
    uint32_t x, y, z, w;
};

AMBILUX_HD uint32_t mul_hi(uint32_t a, uint32_t b) { return uint32_t((uint64_t(a) * b) >> 32); }

/// Philox 4x32 (Salmon et al. 2011, "Parallel Random Numbers: As Easy as 1, 2, 3"). 7 rounds are the fewest that pass
/// BigCrush (table 2); the tests also run the 10 of other libraries.
template <int Rounds = 7>
AMBILUX_HD Uint4 philox4x32(Uint4 c, uint32_t k0, uint32_t k1) {
    for (int round = 0; round < Rounds; ++round) {
        const uint64_t product0 = uint64_t(0xD2511F53u) * c.x, product1 = uint64_t(0xCD9E8D57u) * c.z;
        c = {uint32_t(product1 >> 32) ^ c.y ^ k0, uint32_t(product1), uint32_t(product0 >> 32) ^ c.w ^ k1,
             uint32_t(product0)};
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    return c;
}

/// Uniform float in [0,1) from the upper 24 bits.
AMBILUX_HD float uniform_float(uint32_t bits) { return float(bits >> 8) * 0x1p-24f; }

/// Four uniform 32-bit words for `block` of the sequence.
AMBILUX_HD Uint4 random_bits(const RngKey& key, uint32_t block) {
    return philox4x32({key.index, key.sample, block, uint32_t(key.stream)}, uint32_t(key.seed),
                      uint32_t(key.seed >> 32));
}

AMBILUX_HD Vec4f uniform_floats(const Uint4& b) {
    return {uniform_float(b.x), uniform_float(b.y), uniform_float(b.z), uniform_float(b.w)};
}

/// Four uniform floats in [0,1) for `block` of the sequence.
AMBILUX_HD Vec4f random_floats(const RngKey& key, uint32_t block) { return uniform_floats(random_bits(key, block)); }

/// Where the numbers of a block come from. SobolPoints and ChosenPoints (core/sobol.h) have the same functions.
struct IndependentPoints {
    /// Number i of the n points that a sample has of one decision: they may take the blocks from `block` on.
    AMBILUX_HD static Uint4 bits(const RngKey& key, uint32_t block, uint32_t i = 0, uint32_t = 1) {
        return random_bits(key, block + i);
    }
    /// Numbers of a block for a decision that picks with x, and finds a place or a direction with y and z.
    AMBILUX_HD static Vec4f pick_and_place(Vec4f u) { return u; }
};

/// One uniform float in [0,1) from two words; a cheap hash (Jarzynski and Olano 2020, pcg2d) for decisions that belong
/// to a (ray, primitive) pair and must not depend on the order in which primitives are visited.
AMBILUX_HD float hash_float(uint32_t a, uint32_t b) {
    uint32_t x = a * 1664525u + 1013904223u, y = b * 1664525u + 1013904223u;
    x += y * 1664525u;
    y += x * 1664525u;
    x ^= x >> 16;
    y ^= y >> 16;
    x += y * 1664525u;
    y += x * 1664525u;
    // The second word: it is mixed once more than the first, which is visibly correlated between neighbouring b.
    return uniform_float(y ^ y >> 16);
}

/// One word from four, by a hash that is a quarter of the work of philox4x32 (the same, pcg4d): for seeds of
/// hash_float, one per ray.
AMBILUX_HD uint32_t hash_word(Uint4 v) {
    v = {v.x * 1664525u + 1013904223u, v.y * 1664525u + 1013904223u, v.z * 1664525u + 1013904223u,
         v.w * 1664525u + 1013904223u};
    for (int round = 0; round < 2; ++round) {
        v.x += v.y * v.w;
        v.y += v.z * v.x;
        v.z += v.x * v.y;
        v.w += v.y * v.z;
        if (round == 0) v = {v.x ^ v.x >> 16, v.y ^ v.y >> 16, v.z ^ v.z >> 16, v.w ^ v.w >> 16};
    }
    return v.w ^ v.w >> 16;
}

}  // namespace ambilux
