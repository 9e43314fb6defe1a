// Images of single strategies (s,t), raw and weighted (Veach 1997, figures 10.2 and 10.3). They are gathered beside the
// image and change nothing in it.
#pragma once

#include "core/atomic.h"
#include "core/lane.h"
#include "core/vec.h"
#include "transport/mis/strategy.h"

namespace ambilux {

/// Deepest paths of which images can be asked for.
constexpr uint32_t kMaxStrategyDepth = 16;

struct StrategyFilm {
    double* sums = nullptr;       ///< per strategy: raw image, weighted image. Null: nothing is recorded
    uint64_t* dropped = nullptr;  ///< per strategy: values that were not finite
    Lane* raw = nullptr;          ///< per slot: the unweighted value in flight and its strategy
    uint32_t max_depth = 0;

    /// Those of merges come after the others.
    static constexpr uint32_t images(uint32_t max_depth, bool merges) {
        return strategy_count(max_depth) + (merges ? merge_count(max_depth) : 0);
    }
    /// Notes what a slot's candidate is worth without its weight; a slot has one candidate at a time.
    AMBILUX_HD void remember(uint32_t slot, Rgb value, Strategy strategy) const {
        if (!sums) return;
        const uint32_t words[4] = {float_bits(value.x), float_bits(value.y), float_bits(value.z), strategy.code};
        memcpy(&raw[slot], words, sizeof(words));
    }
    /// What the slot's candidate is worth lacked this factor.
    AMBILUX_HD void scale(uint32_t slot, Rgb factor) const {
        if (sums) remember(slot, start_of<Rgb>(raw[slot]) * factor, {raw[slot].word[3]});
    }
    /// The slot's candidate arrived at a pixel of an image of `pixels`, worth `weighted` with its weight.
    AMBILUX_HD void arrive(uint32_t slot, uint32_t pixels, uint32_t pixel, Rgb weighted) const {
        if (sums) add({raw[slot].word[3]}, pixels, pixel, start_of<Rgb>(raw[slot]), weighted);
    }
    AMBILUX_HD void add(Strategy strategy, uint32_t pixels, uint32_t pixel, Rgb value, Rgb weighted) const {
        if (sums && strategy.segments() <= max_depth) add_to(strategy_index(strategy), pixels, pixel, value, weighted);
    }
    /// A merge (merge_index).
    AMBILUX_HD void add_merge(uint32_t s, uint32_t t, uint32_t pixels, uint32_t pixel, Rgb value, Rgb weighted) const {
        if (sums && s + t - 2 <= max_depth)
            add_to(strategy_count(max_depth) + merge_index(s, t), pixels, pixel, value, weighted);
    }

private:
    AMBILUX_HD void add_to(uint32_t index, uint32_t pixels, uint32_t pixel, Rgb value, Rgb weighted) const {
        const uint64_t image = uint64_t(pixels) * 3;
        if (!is_finite(value) || !is_finite(weighted)) {
            fetch_add_shared(reinterpret_cast<int64_t*>(dropped + index), 1);  // tasks of the host share these counters
            return;
        }
        double* at = sums + 2 * index * image + uint64_t(pixel) * 3;
        for (int c = 0; c < 3; ++c) {
            add_shared(at + c, double(value[c]));
            add_shared(at + image + c, double(weighted[c]));
        }
    }
};

}  // namespace ambilux
