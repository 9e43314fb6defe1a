// Images of single strategies (s,t), raw and weighted (Veach 1997, figures 10.2 and 10.3). They are gathered beside the
// image and change nothing in it.
#pragma once

#include "film/fixed_point.h"
#include "queues/queue.h"
#include "queues/wave.h"

namespace ambilux {

/// A strategy in one word: s vertices from the light, t from the camera, s + t - 1 segments.
struct Strategy {
    uint32_t code;

    AMBILUX_HD static Strategy make(uint32_t s, uint32_t t) { return {s | t << 16}; }
    AMBILUX_HD uint32_t s() const { return code & 0xffffu; }
    AMBILUX_HD uint32_t t() const { return code >> 16; }
    AMBILUX_HD uint32_t segments() const { return s() + t() - 1; }
};

/// Strategies of paths of 1 ... max_depth segments: s = 0 ... k for k segments.
constexpr uint32_t technique_count(uint32_t max_depth) { return max_depth * (max_depth + 3) / 2; }
AMBILUX_HD uint32_t technique_index(Strategy strategy) {
    const uint32_t k = strategy.segments();
    return (k - 1) * (k + 2) / 2 + strategy.s();
}

/// Deepest paths of which images can be asked for.
constexpr uint32_t kMaxTechniqueDepth = 16;

struct TechniqueFilm {
    int64_t* sums = nullptr;      ///< per technique: raw image, weighted image (kLightUnit). Null: nothing is recorded
    Lane* raw = nullptr;          ///< per slot: the unweighted value in flight and its strategy
    uint64_t* dropped = nullptr;  ///< per technique: values that were no numbers or too large to be added
    uint32_t max_depth = 0;

    /// Notes what a slot's candidate is worth without its weight; a slot has one candidate at a time.
    AMBILUX_HD void remember(uint32_t slot, Rgb value, Strategy strategy) const {
        if (!sums) return;
        const uint32_t words[4] = {float_bits(value.x), float_bits(value.y), float_bits(value.z), strategy.code};
        memcpy(&raw[slot], words, sizeof(words));
    }
    /// What the slot's candidate is worth lacked this factor.
    AMBILUX_HD void scale(uint32_t slot, Rgb factor) const {
        if (!sums) return;
        const Lane lane = raw[slot];
        remember(slot, Rgb{bits_float(lane.word[0]), bits_float(lane.word[1]), bits_float(lane.word[2])} * factor,
                 {lane.word[3]});
    }
    /// The slot's candidate arrived, worth `weighted` with its weight.
    AMBILUX_HD void arrive(const Wave& wave, uint32_t slot, Rgb weighted) const {
        if (!sums) return;
        const Lane lane = raw[slot];
        const Rgb value = {bits_float(lane.word[0]), bits_float(lane.word[1]), bits_float(lane.word[2])};
        add(wave, {lane.word[3]}, wave.locate(slot).pixel, value, weighted);
    }
    AMBILUX_HD void add(const Wave& wave, Strategy strategy, uint32_t pixel, Rgb value, Rgb weighted) const {
        if (!sums || strategy.segments() > max_depth) return;
        const uint64_t image = uint64_t(wave.width) * wave.height * 3;
        const uint32_t technique = technique_index(strategy);
        int64_t* at = sums + 2 * technique * image + uint64_t(pixel) * 3;
        const bool finite = is_finite(value) && is_finite(weighted);
        if (finite && add_light(at, value) && add_light(at + image, weighted)) return;
        // Tasks of the host share these counters.
        add_fixed(reinterpret_cast<int64_t*>(dropped + technique), 1);
    }
};

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
