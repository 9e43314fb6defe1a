// Per-pixel sums that every image and every statistic comes from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ambilux {

/// Sums over samples, per pixel and channel, row-major from the top left: value (y*width + x)*3 + channel. Samples of a
/// pixel are independent and identically distributed (the reconstruction filter is sampled, not splatted), so the
/// variance of the mean is sample variance / samples.
struct FilmMoments {
    uint32_t width = 0, height = 0;
    uint64_t samples = 0;  ///< per pixel
    std::vector<double> sum, sum_squares;

    double mean(size_t i) const { return samples ? sum[i] / double(samples) : 0.0; }
    /// Unbiased sample variance of one sample; 0 with fewer than two.
    double variance(size_t i) const {
        if (samples < 2) return 0.0;
        const double n = double(samples), m = sum[i] / n;
        const double v = (sum_squares[i] - n * m * m) / (n - 1.0);
        return v > 0.0 ? v : 0.0;
    }
    /// Standard error of the mean.
    double standard_error(size_t i) const;
    /// Adds the samples of `other`, of the same size.
    void add(const FilmMoments& other);
};

}  // namespace ambilux
