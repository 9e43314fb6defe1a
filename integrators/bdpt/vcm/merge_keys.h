// The order of light vertices, and the iterations that may be done at once.
#pragma once

#include <cstdint>

#include "core/hd.h"

namespace ambilux {

/// Keys put light vertices in the order of iteration, place in the hash table, light subpath and depth, which knows
/// nothing of waves and threads: sums over a cell have the same bits for any number of them. Radix sorts go through no
/// more bits than these.
struct MergeKeys {
    static constexpr uint32_t kLeastTableBits = 8, kMostTableBits = 24;  ///< the most: of all tables together
    static constexpr uint32_t kMostSubpathBits = 29;
    static constexpr uint32_t kMostIterationBits = 7;  ///< at once: keys of queries (query_order.h) have 31 bits

    uint32_t depth_bits, subpath_bits;
    uint32_t table_bits;  ///< of one iteration

    AMBILUX_HD uint32_t shift() const { return depth_bits + subpath_bits; }
    /// In the tables of all iterations.
    AMBILUX_HD uint32_t place(uint32_t iteration, uint32_t hash) const { return iteration << table_bits | hash; }
    AMBILUX_HD uint64_t key(uint32_t place, uint32_t subpath, uint32_t depth) const {
        return uint64_t(place) << shift() | uint64_t(subpath) << depth_bits | (depth & ((1u << depth_bits) - 1));
    }
    AMBILUX_HD uint32_t place(uint64_t key) const { return uint32_t(key >> shift()); }
    AMBILUX_HD uint32_t subpath(uint64_t key) const { return uint32_t(key >> depth_bits) & ((1u << subpath_bits) - 1); }
};

/// Iterations share a radius with those whose numbers have the same four leading binary digits, and more zeros behind
/// them: the radius shrinks in steps of at most 1/8 of an iteration's number, and several iterations can be done at
/// once.
struct RadiusStep {
    uint32_t first, count;

    AMBILUX_HD static RadiusStep of(uint32_t iteration) {
        uint32_t count = 1;
        while (iteration / count >= 16) count *= 2;
        return {iteration / count * count, count};
    }
    AMBILUX_HD uint32_t end() const { return first + count; }
};

}  // namespace ambilux
