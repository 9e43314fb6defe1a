// How weights are learned: by least squares, or by integrals of densities.
#pragma once

#include "integrators/path/optimal/densities.h"
#include "integrators/path/optimal/least_squares.h"

namespace ambilux {

/// What samples have told is an array of doubles and one of floats, whose places are the matter of DensitySums or
/// LeastSquaresSums. Of several pixels both are in one array of doubles, one behind the other.
struct StrategyLearning {
    static constexpr uint32_t kMost = EmitterStrategies::kMost;
    static constexpr uint32_t kMostWords = LeastSquaresSums::words(kMost) + LeastSquaresSums::lack_words(kMost);
    static_assert(kMostWords >= DensitySums::words(kMost));

    EmitterStrategies all;
    OptimalLearning by;

    AMBILUX_HD uint32_t words() const {
        return by_densities() ? DensitySums::words(all.count) : LeastSquaresSums::words(all.count);
    }
    AMBILUX_HD uint32_t lack_words() const { return by_densities() ? 0 : LeastSquaresSums::lack_words(all.count); }
    AMBILUX_HD void add_sample(const VertexStrategies& v, double* sums, float* lacks) const {
        by_densities() ? DensitySums::add_sample(v, sums) : LeastSquaresSums::add_sample(v, all, sums, lacks);
    }
    AMBILUX_HD void add_pixel(double* sums, const double* pixel, const float* lacks) const {
        by_densities() ? DensitySums::add_pixel(sums, pixel, all.count)
                       : LeastSquaresSums::add_pixel(sums, pixel, lacks, all.count);
    }
    AMBILUX_HD void add_from_near(double* sums, const double* near) const {
        by_densities() ? DensitySums::add_from_near(sums, near, all.count)
                       : LeastSquaresSums::add_from_near(sums, near, all.count);
    }
    AMBILUX_HD void solve(const double* sums, Rgb* advantages) const {
        by_densities() ? DensitySums::solve(sums, all, advantages) : LeastSquaresSums::solve(sums, all, advantages);
    }

private:
    AMBILUX_HD bool by_densities() const { return by == OptimalLearning::densities; }
};

}  // namespace ambilux
