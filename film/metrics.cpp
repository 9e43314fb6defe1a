#include "film/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"

namespace ambilux {
namespace {

void check_sizes(uint32_t width, uint32_t height, const Image& reference) {
    if (width != reference.width || height != reference.height)
        throw Error(ExitCode::bad_input, "the image is " + std::to_string(width) + "x" + std::to_string(height) +
                                             " but the reference is " + std::to_string(reference.width) + "x" +
                                             std::to_string(reference.height) + ": render both at the same size");
}

/// Sums over all pixels and channels of d = value - reference, of the standard errors of the reference and of both
/// relative to the reference.
struct ErrorSums {
    double squares = 0, relative = 0, absolute = 0, noise = 0, relative_noise = 0;
    double difference = 0, difference_squares = 0;  ///< of pixels: means of three channels
    double reference = 0;
    uint64_t non_finite = 0;
};
struct PixelError {
    double error, noise;  ///< relative squares
};

template <class Value>
ErrorSums sum_errors(const Reference& reference, Value value, std::vector<PixelError>& by_pixel) {
    const Image& mean = reference.mean;
    const bool errors = reference.standard_error.rgb.size() == mean.rgb.size();
    ErrorSums sums;
    for (size_t p = 0; p < by_pixel.size(); ++p) {
        double pixel = 0;
        PixelError& e = by_pixel[p];
        e = {0, 0};
        for (size_t c = 0; c < 3; ++c) {
            const size_t i = 3 * p + c;
            const double x = value(i), r = mean.rgb[i], d = x - r;
            const double se =
                errors ? double(reference.standard_error.rgb[i]) : std::numeric_limits<double>::quiet_NaN();
            sums.non_finite += !std::isfinite(x);
            sums.squares += d * d;
            sums.relative += d * d / (r * r + 0.01);
            sums.absolute += std::abs(d) / (std::abs(r) + 0.01);
            sums.noise += se * se;
            sums.relative_noise += se * se / (r * r + 0.01);
            e.error += d * d / (r * r + 0.01) / 3;
            e.noise += se * se / (r * r + 0.01) / 3;
            sums.reference += r;
            pixel += d / 3;
        }
        sums.difference += pixel;
        sums.difference_squares += pixel * pixel;
    }
    return sums;
}

/// The comparison keeps NaN: max(0, NaN) would be 0.
double non_negative(double v) { return v < 0 ? 0.0 : v; }

/// Relative error without the pixels of the largest; reorders them.
void set_trimmed(std::vector<PixelError>& by_pixel, Metrics& m) {
    const size_t kept = by_pixel.size() - size_t(kTrimmedShare * double(by_pixel.size()));
    std::nth_element(by_pixel.begin(), by_pixel.begin() + long(kept) - 1, by_pixel.end(),
                     [](const PixelError& a, const PixelError& b) { return a.error < b.error; });
    PixelError sum{0, 0};
    for (size_t p = 0; p < kept; ++p) {
        sum.error += by_pixel[p].error;
        sum.noise += by_pixel[p].noise;
    }
    m.relmse_trimmed = sum.error / double(kept);
    m.relmse_trimmed_corrected = non_negative((sum.error - sum.noise) / double(kept));
}

template <class Value>
Metrics compare_values(uint32_t width, uint32_t height, const Reference& reference, Value value) {
    check_sizes(width, height, reference.mean);
    const size_t pixels = size_t(width) * height;
    std::vector<PixelError> by_pixel(pixels);
    const ErrorSums sums = sum_errors(reference, value, by_pixel);
    const double n = 3.0 * double(pixels);
    Metrics m;
    m.non_finite = sums.non_finite;
    m.rmse = std::sqrt(sums.squares / n);
    m.relmse = sums.relative / n;
    m.mape = sums.absolute / n;
    m.reference_noise = std::sqrt(sums.noise / n);
    m.rmse_corrected = std::sqrt(non_negative((sums.squares - sums.noise) / n));
    m.relmse_corrected = non_negative((sums.relative - sums.relative_noise) / n);
    if (m.non_finite || !std::isfinite(sums.relative))  // outliers of this kind are not forgiven
        m.relmse_trimmed = m.relmse_trimmed_corrected = std::numeric_limits<double>::quiet_NaN();
    else if (pixels)
        set_trimmed(by_pixel, m);
    m.bias = sums.difference / double(pixels);
    m.relative_bias = sums.difference == 0 ? 0 : sums.difference / (sums.reference / 3);
    m.bias_z = sums.difference_squares == 0 ? 0 : sums.difference / std::sqrt(sums.difference_squares);
    return m;
}

}  // namespace

BlockAgreement block_agreement(const Image& image, const Image& reference, uint32_t block, double tolerance) {
    check_sizes(image.width, image.height, reference);
    BlockAgreement result;
    double total = 0, reference_total = 0;
    uint64_t agree = 0, blocks = 0;
    for (uint32_t by = 0; by < image.height; by += block)
        for (uint32_t bx = 0; bx < image.width; bx += block) {
            double x_sum = 0, r_sum = 0;
            for (uint32_t y = by; y < std::min(by + block, image.height); ++y)
                for (size_t i = (size_t(y) * image.width + bx) * 3;
                     i < (size_t(y) * image.width + std::min(bx + block, image.width)) * 3; ++i) {
                    x_sum += image.rgb[i];
                    r_sum += reference.rgb[i];
                }
            total += x_sum;
            reference_total += r_sum;
            const double difference = x_sum == r_sum ? 0 : (x_sum - r_sum) / r_sum;
            ++blocks;
            agree += std::abs(difference) <= tolerance;  // false for NaN
            if (!(std::abs(difference) <= std::abs(result.worst))) {
                result.worst = difference;
                result.worst_x = bx;
                result.worst_y = by;
            }
        }
    result.relative_mean = total == reference_total ? 0 : (total - reference_total) / reference_total;
    result.within = double(agree) / double(blocks);
    return result;
}

Metrics compare_images(const Image& image, const Reference& reference) {
    return compare_values(image.width, image.height, reference, [&](size_t i) { return double(image.rgb[i]); });
}

Metrics compare_images(const FilmMoments& image, const Reference& reference) {
    return compare_values(image.width, image.height, reference, [&](size_t i) { return image.mean(i); });
}

nlohmann::json to_json(const Metrics& m) {
    const auto number = [](double v) { return std::isfinite(v) ? nlohmann::json(v) : nlohmann::json(nullptr); };
    return {{"rmse", number(m.rmse)},
            {"rmse_corrected", number(m.rmse_corrected)},
            {"reference_noise", number(m.reference_noise)},
            {"relmse", number(m.relmse)},
            {"relmse_corrected", number(m.relmse_corrected)},
            {"relmse_trimmed", number(m.relmse_trimmed)},
            {"relmse_trimmed_corrected", number(m.relmse_trimmed_corrected)},
            {"mape", number(m.mape)},
            {"bias", number(m.bias)},
            {"relative_bias", number(m.relative_bias)},
            {"bias_z", number(m.bias_z)},
            {"non_finite", m.non_finite}};
}

}  // namespace ambilux
