// How weights are learned: by least squares, or by integrals of densities.
#pragma once

#include "integrators/path/optimal/densities.h"
#include "integrators/path/optimal/least_squares.h"

namespace ambilux {

/// What samples have told is an array of doubles, whose places are the matter of DensitySums or LeastSquaresSums.
struct StrategyLearning {
    static constexpr uint32_t kMost = EmitterStrategies::kMost;
    static constexpr uint32_t kMostWords = DensitySums::words(kMost) > LeastSquaresSums::words(kMost)
                                               ? DensitySums::words(kMost)
                                               : LeastSquaresSums::words(kMost);

    EmitterStrategies all;
    OptimalLearning by;

    AMBILUX_HD uint32_t words() const {
        return by_densities() ? DensitySums::words(all.count) : LeastSquaresSums::words(all.count);
    }
    AMBILUX_HD void add_sample(const VertexStrategies& v, double* sums) const {
        by_densities() ? DensitySums::add_sample(v, sums) : LeastSquaresSums::add_sample(v, all, sums);
    }
    AMBILUX_HD void add_pixel(double* sums, const double* pixel) const {
        by_densities() ? DensitySums::add_pixel(sums, pixel, all.count)
                       : LeastSquaresSums::add_pixel(sums, pixel, all.count);
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
