// What variant optimal keeps from iteration to iteration: what samples have told, and the weights that follow.
#pragma once

#include "integrators/kept_state.h"
#include "integrators/path/optimal/learning.h"

namespace ambilux {

/// Blocks of pixels of a film.
struct PixelBlocks {
    uint32_t width, height;  ///< pixels
    uint32_t side;           ///< of a block

    AMBILUX_HD uint32_t in_row() const { return (width + side - 1) / side; }
    AMBILUX_HD uint32_t count() const { return in_row() * ((height + side - 1) / side); }
    AMBILUX_HD uint32_t of(uint32_t x, uint32_t y) const { return y / side * in_row() + x / side; }
    /// f(x, y) for the pixels of a block.
    template <class Each>
    AMBILUX_HD void for_pixels(uint32_t block, Each f) const {
        const uint32_t first_x = block % in_row() * side, first_y = block / in_row() * side;
        for (uint32_t y = first_y; y < min(first_y + side, height); ++y)
            for (uint32_t x = first_x; x < min(first_x + side, width); ++x) f(x, y);
    }
};

struct OptimalState {
    static constexpr StateKind kKind = StateKind::per_device;
    static constexpr uint32_t kNeighbourhood = 8;  ///< side, in pixels

    double* sums;  ///< [pixel][vertex][StrategyLearning], each pixel by itself: added up in the order of its samples
    float* lacks;  ///< the same
    double* near;  ///< [neighbourhood][vertex][StrategyLearning, both arrays]: of its pixels
    Lane* advantages;  ///< [block][vertex][strategy]: StrategyLearning::solve
    PixelBlocks blocks, neighbourhoods;
    uint32_t vertices, strategies, words, lack_words;

    AMBILUX_HD double* sums_of(uint32_t pixel, uint32_t vertex) const {
        return sums + (uint64_t(pixel) * vertices + vertex) * words;
    }
    AMBILUX_HD float* lacks_of(uint32_t pixel, uint32_t vertex) const {
        return lacks + (uint64_t(pixel) * vertices + vertex) * lack_words;
    }
    AMBILUX_HD double* near_of(uint32_t neighbourhood, uint32_t vertex) const {
        return near + (uint64_t(neighbourhood) * vertices + vertex) * (words + lack_words);
    }
    AMBILUX_HD Lane* advantages_of(uint32_t block, uint32_t vertex) const {
        return advantages + (uint64_t(block) * vertices + vertex) * strategies;
    }

    uint64_t sum_count() const { return uint64_t(blocks.width) * blocks.height * vertices * words; }
    uint64_t lack_count() const { return uint64_t(blocks.width) * blocks.height * vertices * lack_words; }
    uint64_t advantage_count() const { return uint64_t(blocks.count()) * vertices * strategies; }

    template <class Policy>
    static OptimalState lay_out(Layout& layout, const Policy& p, const StateSize&) {
        OptimalState s{};
        s.blocks = p.blocks;
        s.neighbourhoods = {p.blocks.width, p.blocks.height, kNeighbourhood};
        s.vertices = p.sampling.settings.vertices;
        s.strategies = p.learning.all.count;
        s.words = p.learning.words();
        s.lack_words = p.learning.lack_words();
        s.sums = layout.allocate<double>(s.sum_count());
        s.lacks = layout.allocate<float>(s.lack_count());
        s.near = layout.allocate<double>(uint64_t(s.neighbourhoods.count()) * s.vertices * (s.words + s.lack_words));
        s.advantages = layout.allocate<Lane>(s.advantage_count());
        return s;
    }
    template <class Policy, class Put>
    void init(const Policy&, Put) const {}
    template <class Visit>
    void for_each_saved(Visit visit) const {
        visit("optimal_sums", sums, sum_count());
        visit("optimal_lacks", lacks, lack_count());
        visit("optimal_advantages", advantages, advantage_count());
    }
};

}  // namespace ambilux
