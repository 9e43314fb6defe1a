// Strategies (s,t) of bidirectional path tracing: s vertices sampled from the light, t from the camera (Veach 1997).
#pragma once

#include "core/math.h"

namespace ambilux {

/// A strategy in one word; its paths have s + t - 1 segments.
struct Strategy {
    uint32_t code;

    AMBILUX_HD static Strategy make(uint32_t s, uint32_t t) { return {s | t << 16}; }
    AMBILUX_HD uint32_t s() const { return code & 0xffffu; }
    AMBILUX_HD uint32_t t() const { return code >> 16; }
    AMBILUX_HD uint32_t segments() const { return s() + t() - 1; }
};

/// Groups of strategies that can be switched off; weights then sum to one over the rest.
enum StrategyBits : uint32_t {
    kHitStrategies = 1,         ///< s = 0: the eye subpath meets an emitter
    kNextEventStrategies = 2,   ///< s = 1, t >= 2
    kConnectionStrategies = 4,  ///< s >= 2, t >= 2
    kLightStrategies = 8,       ///< t = 1
    kAllStrategies = 15
};

/// Strategies of paths of 1 ... max_depth segments: s = 0 ... k for k segments.
constexpr uint32_t strategy_count(uint32_t max_depth) { return max_depth * (max_depth + 3) / 2; }
AMBILUX_HD uint32_t strategy_index(Strategy strategy) {
    const uint32_t k = strategy.segments();
    return (k - 1) * (k + 2) / 2 + strategy.s();
}

/// Merges of a light subpath of s vertices with an eye subpath of t at one vertex that both count: s and t are at least
/// 2, and paths have s + t - 2 segments.
constexpr uint32_t merge_count(uint32_t max_depth) { return max_depth > 0 ? max_depth * (max_depth - 1) / 2 : 0; }
AMBILUX_HD uint32_t merge_index(uint32_t s, uint32_t t) {
    const uint32_t k = s + t - 2;
    return (k - 1) * (k - 2) / 2 + s - 2;
}

/// The single strategies that are on, at most one for any number of segments, so that their weights are 1.
struct SingleStrategies {
    static constexpr uint32_t kMaxSegments = 31;
    static constexpr uint8_t kNone = 0xff;

    bool on = false;  ///< false: strategies are on in groups
    uint8_t s[kMaxSegments + 1] = {};

    AMBILUX_HD bool has(Strategy strategy) const {
        return !on || (strategy.segments() <= kMaxSegments && s[strategy.segments()] == strategy.s());
    }
};

}  // namespace ambilux
