#include "film/ztest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "film/distributions.h"

namespace ambilux {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/// Sums over the pixels of one block and channel, for one image.
struct Side {
    double mean = 0;           ///< sum of means
    double variance = 0;       ///< sum of variances of means
    double dof_terms = 0;      ///< sum of v²/(n-1), for Welch-Satterthwaite
    double value = 0;          ///< sum of sample values
    double squares = 0;        ///< sum of squared sample values
    double max_abs = 0;
    bool random = false;       ///< has pixels that are not exactly known

    void add(const Side& s) {
        mean += s.mean;
        variance += s.variance;
        dof_terms += s.dof_terms;
        value += s.value;
        squares += s.squares;
        max_abs += s.max_abs;
        random = random || s.random;
    }
};

struct Block {
    Side a, b;
    uint32_t pixels = 0;
};

/// Adds one pixel: mean m, variance v of that mean, n samples (0: exact).
void add_pixel(Side& s, double m, double v, uint64_t n) {
    s.mean += m;
    s.max_abs += std::abs(m);
    if (n == 0) return;
    s.random = true;
    const double count = double(n);
    s.variance += v;
    s.dof_terms += v * v / (count - 1);
    s.value += count * m;
    s.squares += v * count * (count - 1) + count * m * m;
}

/// Effective number of samples: infinite where nothing is random, 0 where a random image is black, which may only mean that it has met no light yet.
double effective(const Side& s) {
    if (!s.random) return kInf;
    if (s.squares == 0) return 0;
    return s.variance == 0 ? kInf : s.value * s.value / s.squares;
}

/// Normal equivalent of the difference of the block's means; NaN if there are too few effective samples to say.
double block_z(const Block& block, const ZTestOptions& options) {
    const double difference = block.a.mean - block.b.mean;
    if (!std::isfinite(difference)) return kInf;
    const double rounding = options.rounding * std::max(block.a.max_abs, block.b.max_abs);
    const double variance = block.a.variance + block.b.variance;
    if (!std::isfinite(variance)) return kInf;
    if (std::abs(difference) <= rounding) return 0;
    const double n_a = effective(block.a), n_b = effective(block.b);
    if (std::min(n_a, n_b) < options.min_effective) return std::numeric_limits<double>::quiet_NaN();
    if (variance == 0) return std::copysign(kInf, difference);

    double t = std::abs(difference) / std::sqrt(variance + rounding * rounding);
    // Hall's transformation, for the skewness of the darker side, weighted by its share of the variance.
    const Side& dark = difference < 0 ? block.a : block.b;
    if (dark.variance > 0) {
        const double g = std::pow(dark.variance / variance, 1.5) / std::sqrt(effective(dark));
        t = std::max(0.0, std::min(t, t - g * t * t / 3 + g * g * t * t * t / 27 - g / 6));
    }
    const double dof = variance * variance / (block.a.dof_terms + block.b.dof_terms);
    const double z = std::min(normal_tail_inverse(student_tail(t, dof)), t);
    return std::copysign(z, difference);
}

std::vector<Block> smallest_blocks(const Estimate& a, const Estimate& b, const ZTestOptions& options, uint32_t columns, uint32_t rows) {
    std::vector<Block> blocks(size_t(columns) * rows * 3);
    for (uint32_t y = 0; y < a.height; ++y)
        for (uint32_t x = 0; x < a.width; ++x) {
            const size_t block = size_t(y / options.block) * columns + x / options.block;
            for (size_t c = 0; c < 3; ++c) {
                const size_t i = (size_t(y) * a.width + x) * 3 + c;
                double va = a.variance_of_mean[i], vb = b.variance_of_mean[i];
                if (options.same_estimator && a.samples && b.samples) {
                    const double na = double(a.samples), nb = double(b.samples);
                    const double pooled = (va * na * (na - 1) + vb * nb * (nb - 1)) / (na + nb - 2);
                    va = pooled / na;
                    vb = pooled / nb;
                }
                Block& target = blocks[block * 3 + c];
                add_pixel(target.a, a.mean[i], va, a.samples);
                add_pixel(target.b, b.mean[i], vb, b.samples);
                ++target.pixels;
            }
        }
    return blocks;
}

std::vector<Block> merge(const std::vector<Block>& blocks, uint32_t columns, uint32_t rows) {
    const uint32_t new_columns = (columns + 1) / 2, new_rows = (rows + 1) / 2;
    std::vector<Block> merged(size_t(new_columns) * new_rows * 3);
    for (uint32_t y = 0; y < rows; ++y)
        for (uint32_t x = 0; x < columns; ++x)
            for (size_t c = 0; c < 3; ++c) {
                const Block& from = blocks[(size_t(y) * columns + x) * 3 + c];
                Block& to = merged[(size_t(y / 2) * new_columns + x / 2) * 3 + c];
                to.a.add(from.a);
                to.b.add(from.b);
                to.pixels += from.pixels;
            }
    return merged;
}

void check(const Estimate& e, const ZTestOptions& options, const char* name) {
    if (e.samples && e.samples < std::max<uint64_t>(options.min_samples, 2))
        throw Error(ExitCode::bad_input, fmt::format("image {} has {} samples per pixel; the statistical comparison needs at least {}", name, e.samples,
                                                     std::max<uint64_t>(options.min_samples, 2)));
    const size_t size = size_t(e.width) * e.height * 3;
    if (size == 0 || e.mean.size() != size || e.variance_of_mean.size() != size)
        throw Error(ExitCode::bad_input, fmt::format("image {} is empty or its buffers do not fit its size", name));
}

}  // namespace

Estimate to_estimate(const FilmMoments& m) {
    if (m.samples < 2) throw Error(ExitCode::bad_input, "an image of fewer than two samples per pixel has no variance");
    Estimate e{m.width, m.height, m.samples, std::vector<double>(m.sum.size()), std::vector<double>(m.sum.size())};
    for (size_t i = 0; i < m.sum.size(); ++i) {
        e.mean[i] = m.mean(i);
        e.variance_of_mean[i] = m.variance(i) / double(m.samples);
    }
    return e;
}

Estimate to_estimate(const Reference& r) {
    Estimate e = exact_estimate(r.mean);
    if (r.standard_error.rgb.empty()) return e;
    if (r.samples < 2) throw Error(ExitCode::bad_input, "the reference has standard errors but states no sample count");
    e.samples = r.samples;
    for (size_t i = 0; i < e.mean.size(); ++i) e.variance_of_mean[i] = double(r.standard_error.rgb[i]) * double(r.standard_error.rgb[i]);
    return e;
}

Estimate exact_estimate(const Image& image) {
    return {image.width, image.height, 0, std::vector<double>(image.rgb.begin(), image.rgb.end()), std::vector<double>(image.rgb.size())};
}

ZTestResult z_test(const Estimate& a, const Estimate& b, const ZTestOptions& options) {
    check(a, options, "a");
    check(b, options, "b");
    if (a.width != b.width || a.height != b.height)
        throw Error(ExitCode::bad_input, fmt::format("images differ in size: {}x{} and {}x{}", a.width, a.height, b.width, b.height));
    uint32_t size = std::max(1u, options.block), columns = (a.width + size - 1) / size, rows = (a.height + size - 1) / size;
    std::vector<Block> blocks = smallest_blocks(a, b, options, columns, rows);

    ZTestResult r;
    for (bool first = true;; first = false) {
        const bool whole = columns == 1 && rows == 1;
        double count[3] = {0, 0, 0};
        for (uint32_t y = 0; y < rows; ++y)
            for (uint32_t x = 0; x < columns; ++x)
                for (uint32_t c = 0; c < 3; ++c) {
                    const Block& block = blocks[(size_t(y) * columns + x) * 3 + c];
                    const double z = block_z(block, options);
                    if (whole) r.mean_z[c] = z;
                    if (std::isnan(z)) {
                        r.inconclusive += first;
                        r.undecided = r.undecided || whole;
                        continue;
                    }
                    ++r.tests;
                    if (first) {
                        r.chi_square[c] += z * z;
                        ++count[c];
                    }
                    if (std::abs(z) > std::abs(r.worst_z) || r.worst_width == 0) {
                        r.worst_z = z;
                        r.worst_x = x * size;
                        r.worst_y = y * size;
                        r.worst_width = std::min(size, a.width - r.worst_x);
                        r.worst_height = std::min(size, a.height - r.worst_y);
                        r.worst_channel = c;
                        r.worst_a = block.a.mean / block.pixels;
                        r.worst_b = block.b.mean / block.pixels;
                    }
                }
        if (first)
            for (int c = 0; c < 3; ++c) {
                r.chi_square_dof = std::max(r.chi_square_dof, count[c]);
                if (count[c] > 0) r.p_chi_square = std::min(r.p_chi_square, std::min(1.0, 3 * chi_square_tail(r.chi_square[c], count[c])));
            }
        if (whole) break;
        blocks = merge(blocks, columns, rows);
        size *= 2;
        columns = (columns + 1) / 2;
        rows = (rows + 1) / 2;
    }

    r.p_worst = r.tests ? sidak(2 * normal_tail(std::abs(r.worst_z)), double(r.tests)) : 1;
    double total_a = 0, total_b = 0, deviation = 0;
    for (const Block& block : blocks) {
        total_a += block.a.mean;
        total_b += block.b.mean;
        // Channels of a pixel may be fully correlated: deviations add.
        deviation += std::sqrt(block.a.variance + block.b.variance);
    }
    r.relative_difference = total_a == total_b ? 0 : (total_a - total_b) / total_b;
    const double threshold = normal_tail_inverse(0.5 * sidak_level(0.5 * options.significance, std::max<double>(1, double(r.tests))));
    r.detectable = threshold * deviation / std::abs(total_b);
    r.pass = !r.undecided && r.p_worst >= 0.5 * options.significance && r.p_chi_square >= 0.5 * options.significance;
    return r;
}

std::string ZTestResult::report() const {
    return fmt::format(
        "{}: worst block z = {:+.2f} (corrected p = {:.2g}) of {} tests\n"
        "  at {},{} size {}x{} channel {}: {:.6g} against {:.6g}\n"
        "  whole image z = {:+.2f} {:+.2f} {:+.2f}, relative difference {:+.3g} (would fail from {:.2g})\n"
        "  chi-square {:.1f} {:.1f} {:.1f} over {} blocks, corrected p = {:.2g}; {} smallest blocks left to larger ones{}",
        pass ? "pass" : "FAIL", worst_z, p_worst, tests, worst_x, worst_y, worst_width, worst_height, "RGB"[worst_channel], worst_a, worst_b, mean_z[0],
        mean_z[1], mean_z[2], relative_difference, detectable, chi_square[0], chi_square[1], chi_square[2], chi_square_dof, p_chi_square, inconclusive,
        undecided ? "\n  a channel has too few effective samples in the whole image: nothing is shown, use more samples" : "");
}

MitsubaZTest mitsuba_z_test(const Image& mean, uint64_t spp, const Image& ref, const Image& ref_variance) {
    if (mean.width != ref.width || mean.height != ref.height || ref.width != ref_variance.width || ref.height != ref_variance.height)
        throw Error(ExitCode::bad_input, fmt::format("images differ in size: {}x{}, reference {}x{}, variance {}x{}", mean.width, mean.height, ref.width,
                                                     ref.height, ref_variance.width, ref_variance.height));
    // Linear Rec.709 to CIE XYZ (IEC 61966-2-1 with D65).
    constexpr double kToXyz[3][3] = {{0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169}, {0.019334, 0.119193, 0.950227}};
    const auto to_xyz = [&](const Image& image, size_t pixel, uint32_t c) {
        const float* p = &image.rgb[pixel * 3];
        return kToXyz[c][0] * p[0] + kToXyz[c][1] * p[1] + kToXyz[c][2] * p[2];
    };
    const size_t pixels = size_t(mean.width) * mean.height;
    const double level = sidak_level(0.01, double(pixels));
    MitsubaZTest r;
    uint64_t passed = 0;
    for (size_t p = 0; p < pixels; ++p)
        for (uint32_t c = 0; c < 3; ++c) {
            const double variance = std::max(to_xyz(ref_variance, p, c), 1e-4);
            const double z = std::abs(to_xyz(mean, p, c) - to_xyz(ref, p, c)) * std::sqrt(double(spp) / variance);
            passed += 2 * normal_tail(z) > level;  // false for NaN
            if (!(z <= r.worst_z)) {
                r.worst_z = z;
                r.worst_x = uint32_t(p % mean.width);
                r.worst_y = uint32_t(p / mean.width);
                r.worst_channel = c;
            }
        }
    r.passed_fraction = double(passed) / double(3 * pixels);
    r.pass = r.passed_fraction >= 0.9975;
    return r;
}

}  // namespace ambilux
