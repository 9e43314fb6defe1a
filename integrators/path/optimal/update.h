// Optimal weights: samples become those with the weights that were learned, and teach the next iteration.
#pragma once

#include "integrators/path/optimal/records.h"
#include "integrators/path/optimal/state.h"
#include "stages/update_film.h"

namespace ambilux {

/// Camera rays in slots that have no records yet.
template <class Generate>
struct GenerateRecorded : Generate {
    StrategyRecords records{};

    using Ray = typename Generate::Items::Ray;

    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (make(slot, ray)) this->rays.push(ray);
    }
    AMBILUX_HD bool make(uint32_t slot, Ray& ray) const {
        records.clear(slot);
        return Generate::make(slot, ray);
    }
};

/// What optimal weights add to those of the balance heuristic at a vertex, over its scale. A variate of mean zero: of
/// what a sample has found, other strategies get a part in proportion to their densities, and the pick of a strategy is
/// weighed against its probability.
AMBILUX_HD Rgb optimal_difference(const VertexStrategies& v, const EmitterStrategies& all, const Lane* advantages) {
    const Rgb picked = start_of<Rgb>(advantages[v.next_event_strategy]);
    Rgb sum = picked * (v.next_event.other - 1.0f);
    for (uint32_t k = 0; k < all.count; ++k) sum = sum + start_of<Rgb>(advantages[k]) * all.probability[k];
    return sum - start_of<Rgb>(advantages[v.hit_strategy]) * v.hit.other;
}

/// In the place of UpdateFilm, which finds nothing left to add: samples with optimal weights may be negative.
struct AddOptimal {
    static constexpr const char* kName = "optimal_film";

    Wave wave;
    StrategyLearning learning;
    StrategyRecords records;
    OptimalState state;
    Lane* samples;
    FilmSums film;
    StageRecord* record;

    /// `i` is a slot of the wave's first sample.
    AMBILUX_HD void operator()(uint32_t i) const {
        const PathSlot p = wave.locate(i);
        if (!p.active) return;
        const uint32_t block = state.blocks.of(p.x, p.y), stride = wave.tiles * kTilePixels;
        for (uint32_t k = 0; k < wave.state->samples; ++k) {
            const uint32_t slot = i + k * stride;
            Rgb value = start_of<Rgb>(samples[slot]);
            for (uint32_t v = 0; v < state.vertices; ++v) {
                const VertexStrategies vertex = records.items.load(records.place(slot, v + 1));
                if (!(vertex.scale > 0.0f)) continue;
                value = value + optimal_difference(vertex, learning.all, state.advantages_of(block, v)) * vertex.scale;
                learning.add_sample(vertex, state.sums_of(p.pixel, v), state.lacks_of(p.pixel, v));
            }
            add(uint64_t(p.pixel) * 3, value);
            samples[slot] = {};
        }
    }

private:
    AMBILUX_HD void add(uint64_t at, Rgb value) const {
        if (!is_finite(value)) {
            is_valid_radiance(value, record);  // counts it
            return;
        }
        for (int c = 0; c < 3; ++c) {
            film.sum[at + c] += double(value[c]);
            film.sum_squares[at + c] += double(value[c]) * double(value[c]);
        }
    }
};

/// Of all pixels of a neighbourhood.
struct SumNeighbourhoods {
    static constexpr const char* kName = "optimal_sum";

    StrategyLearning learning;
    OptimalState state;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        for (uint32_t v = 0; v < state.vertices; ++v)
            add_up(learning, state, state.neighbourhoods, i, v, state.near_of(i, v));
    }
    /// The sums of the pixels of a block.
    AMBILUX_HD static void add_up(const StrategyLearning& learning, const OptimalState& state,
                                  const PixelBlocks& blocks, uint32_t block, uint32_t vertex, double* sums) {
        for (uint32_t k = 0; k < state.words + state.lack_words; ++k) sums[k] = 0.0;
        blocks.for_pixels(block, [&](uint32_t x, uint32_t y) {
            const uint32_t pixel = y * blocks.width + x;
            learning.add_pixel(sums, state.sums_of(pixel, vertex), state.lacks_of(pixel, vertex));
        });
    }
};

/// Weights of a block from what its pixels have summed up, and those around it.
struct SolveBlocks {
    static constexpr const char* kName = "optimal_solve";

    StrategyLearning learning;
    OptimalState state;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t block) const {
        const PixelBlocks& b = state.blocks;
        const uint32_t middle_x = min(block % b.in_row() * b.side + b.side / 2, b.width - 1),
                       middle_y = min(block / b.in_row() * b.side + b.side / 2, b.height - 1);
        for (uint32_t v = 0; v < state.vertices; ++v) {
            double sums[StrategyLearning::kMostWords];
            SumNeighbourhoods::add_up(learning, state, b, block, v, sums);
            learning.add_from_near(sums, state.near_of(state.neighbourhoods.of(middle_x, middle_y), v));
            Rgb advantages[EmitterStrategies::kMost];
            learning.solve(sums, advantages);
            for (uint32_t k = 0; k < learning.all.count; ++k)
                set_start(state.advantages_of(block, v)[k], advantages[k]);
        }
    }
};

}  // namespace ambilux
