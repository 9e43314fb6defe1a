// What samples tell about the weights of least variance (Kondapaneni, Vévoda, Grittmann, Skřivan, Slusallek and
// Křivánek 2019, "Optimal Multiple Importance Sampling"): integrals of products of densities, as in their equations.
#pragma once

#include "integrators/path/optimal/strategies.h"

namespace ambilux {

/// What samples have told about the strategies of a vertex, in places of an array of doubles. With w the weight of the
/// balance heuristic, y the light of a sample times it, and s the scale of the vertex, sums over samples.
struct DensitySums {
    static constexpr uint32_t kVertices = 0;  ///< how many vertices
    static constexpr uint32_t kScaleSquared = 1;
    static constexpr uint32_t kHit = 2;  ///< three channels: s y w(hit)
    AMBILUX_HD static constexpr uint32_t overlap(uint32_t strategy) { return 5 + 4 * strategy; }  ///< s² w(hit) w(nee)
    AMBILUX_HD static constexpr uint32_t next_event(uint32_t strategy) { return 6 + 4 * strategy; }  ///< s y w(nee)
    AMBILUX_HD static constexpr uint32_t words(uint32_t strategies) { return 5 + 4 * strategies; }

    /// Of what the strategies of a vertex found.
    AMBILUX_HD static void add_sample(const VertexStrategies& v, double* sums) {
        const double s = double(v.scale);
        sums[kVertices] += 1.0;
        sums[kScaleSquared] += s * s;
        const auto add = [&](const FoundLight& light, uint32_t strategy, bool by_hit) {
            if (is_zero(light.weighted)) return;
            const double other = double(light.other), own = 1.0 - other, hit = by_hit ? own : other;
            sums[overlap(strategy)] += s * s * own * other;
            for (int c = 0; c < 3; ++c) {
                const double y = s * double(light.weighted[c]);
                sums[kHit + c] += y * hit;
                sums[next_event(strategy) + c] += y * (1.0 - hit);
            }
        };
        add(v.next_event, v.next_event_strategy, false);
        add(v.hit, v.hit_strategy, true);
    }
    /// To what a block knows, what one of its pixels does.
    AMBILUX_HD static void add_pixel(double* sums, const double* pixel, uint32_t strategies) {
        for (uint32_t k = 0; k < words(strategies); ++k) sums[k] += pixel[k];
    }
    /// To the sums of a block of pixels as much as some vertices near it have told, in the mean: what a block knows by
    /// itself outweighs them once it has had more. To those as many vertices that have found nothing.
    AMBILUX_HD static void add_from_near(double* sums, const double* near, uint32_t strategies) {
        constexpr double kFromNear = 8.0, kNothing = 4.0;
        const double n = near[kVertices];
        if (!(n > 0.0)) return;
        const double scale = kFromNear / (n + kNothing);
        for (uint32_t k = 0; k < words(strategies); ++k) sums[k] += near[k] * scale;
        sums[kScaleSquared] += near[kScaleSquared] * (kFromNear / n - scale);
    }
    /// `advantages`: of each strategy of next event estimation, α(strategy) / probability - α(hit), where α solves A α
    /// = b. A has the products of next event estimation and hits beside its diagonal alone, since emitters do not
    /// overlap, and its rows times the numbers of samples sum to one: the solution is closed.
    AMBILUX_HD static void solve(const double* sums, const EmitterStrategies& all, Rgb* advantages) {
        constexpr double kLeastRest = 0.02;  // A is positive definite, but not always what few samples say of it
        const double m = sums[kScaleSquared];
        for (uint32_t k = 0; k < all.count; ++k) advantages[k] = {0.0f, 0.0f, 0.0f};
        if (!(m > 0.0)) return;
        double shared[EmitterStrategies::kMost], rest = 1.0;  // A(strategy, hit), at most 1 / (1 + probability)
        for (uint32_t k = 0; k < all.count; ++k) {
            const double p = double(all.probability[k]), a = sums[overlap(k)] / (m * p), most = 1.0 / (1.0 + p);
            shared[k] = p > 0.0 ? (a < most ? a : most) : 0.0;
            rest -= p * shared[k] / (1.0 - shared[k]);
        }
        if (rest < kLeastRest) rest = kLeastRest;
        for (int c = 0; c < 3; ++c) {
            double hit = sums[kHit + c];
            for (uint32_t k = 0; k < all.count; ++k) hit -= shared[k] / (1.0 - shared[k]) * sums[next_event(k) + c];
            hit /= m * rest;
            for (uint32_t k = 0; k < all.count; ++k) {
                const double p = double(all.probability[k]);
                if (!(p > 0.0)) continue;
                const double best = sums[next_event(k) + c] / (m * p) - shared[k] * hit;
                advantages[k][c] = float(best / (1.0 - shared[k]) - hit);
            }
        }
    }
};

}  // namespace ambilux
