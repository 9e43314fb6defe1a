// Strategies that find the light of an emitter at a vertex, and the weights of least variance (Kondapaneni, Vévoda,
// Grittmann, Skřivan, Slusallek and Křivánek 2019, "Optimal Multiple Importance Sampling"). Hits by BSDF sampling are
// one strategy; next event estimation is one for each of the emitters that it picks most often and one for the others,
// of which a vertex samples one (docs/theory.md, 11).
#pragma once

#include "core/vec.h"
#include "integrators/path/optimal/settings.h"

namespace ambilux {

/// Next event estimation as several strategies, by the emitter that was picked.
struct EmitterStrategies {
    static constexpr uint32_t kMost = OptimalSettings::kMostStrategies;

    uint32_t count;
    uint32_t emitters[kMost - 1];  ///< those that are a strategy each: all but the last
    float probability[kMost];      ///< that a vertex samples this strategy

    AMBILUX_HD uint32_t of(uint32_t emitter) const {
        for (uint32_t k = 0; k + 1 < count; ++k)
            if (emitters[k] == emitter) return k;
        return count - 1;
    }
};

/// What samples have told about the strategies of a vertex, in places of an array of doubles. With w the weight of the
/// balance heuristic, y the light of a sample times it, and s the scale of the vertex, sums over samples.
struct StrategySums {
    static constexpr uint32_t kVertices = 0;  ///< how many vertices
    static constexpr uint32_t kScaleSquared = 1;
    static constexpr uint32_t kHit = 2;  ///< three channels: s y w(hit)
    AMBILUX_HD static constexpr uint32_t overlap(uint32_t strategy) { return 5 + 4 * strategy; }  ///< s² w(hit) w(nee)
    AMBILUX_HD static constexpr uint32_t next_event(uint32_t strategy) { return 6 + 4 * strategy; }  ///< s y w(nee)
    AMBILUX_HD static constexpr uint32_t words(uint32_t strategies) { return 5 + 4 * strategies; }
};

/// To the sums of a block of pixels as much as some vertices near it have told, in the mean: what a block knows by
/// itself outweighs them once it has had more. To those as many vertices that have found nothing.
AMBILUX_HD void add_from_near(double* sums, const double* near, uint32_t words) {
    constexpr double kFromNear = 8.0, kNothing = 4.0;
    const double n = near[StrategySums::kVertices];
    if (!(n > 0.0)) return;
    const double scale = kFromNear / (n + kNothing);
    for (uint32_t k = 0; k < words; ++k) sums[k] += near[k] * scale;
    sums[StrategySums::kScaleSquared] += near[StrategySums::kScaleSquared] * (kFromNear / n - scale);
}

/// `advantages`: of each strategy of next event estimation, α(strategy) / probability - α(hit), where α solves A α = b.
/// A has the products of next event estimation and hits beside its diagonal alone, since emitters do not overlap, and
/// its rows times the numbers of samples sum to one: the solution is closed.
AMBILUX_HD void solve_strategies(const double* sums, const EmitterStrategies& all, Rgb* advantages) {
    constexpr double kLeastRest = 0.02;  // A is positive definite, but not always what few samples say of it
    const double m = sums[StrategySums::kScaleSquared];
    for (uint32_t k = 0; k < all.count; ++k) advantages[k] = {0.0f, 0.0f, 0.0f};
    if (!(m > 0.0)) return;
    double overlap[EmitterStrategies::kMost], rest = 1.0;  // A(strategy, hit), at most 1 / (1 + probability)
    for (uint32_t k = 0; k < all.count; ++k) {
        const double p = double(all.probability[k]), a = sums[StrategySums::overlap(k)] / (m * p),
                     most = 1.0 / (1.0 + p);
        overlap[k] = p > 0.0 ? (a < most ? a : most) : 0.0;
        rest -= p * overlap[k] / (1.0 - overlap[k]);
    }
    if (rest < kLeastRest) rest = kLeastRest;
    for (int c = 0; c < 3; ++c) {
        double hit = sums[StrategySums::kHit + c];
        for (uint32_t k = 0; k < all.count; ++k)
            hit -= overlap[k] / (1.0 - overlap[k]) * sums[StrategySums::next_event(k) + c];
        hit /= m * rest;
        for (uint32_t k = 0; k < all.count; ++k) {
            const double p = double(all.probability[k]);
            if (!(p > 0.0)) continue;
            const double next_event = sums[StrategySums::next_event(k) + c] / (m * p) - overlap[k] * hit;
            advantages[k][c] = float(next_event / (1.0 - overlap[k]) - hit);
        }
    }
}

}  // namespace ambilux
