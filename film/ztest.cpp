#include "film/ztest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/distributions.h"
#include "core/error.h"
#include "film/block_sums.h"

namespace ambilux {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/// Normal equivalent of the difference of a block's means.
double block_z(const BlockSum& a, const BlockSum& b, const ZTestOptions& options) {
    const double difference = a.mean - b.mean, variance = a.variance + b.variance;
    if (!std::isfinite(difference) || !std::isfinite(variance)) return kInf;
    const double rounding = options.rounding * std::max(a.max_abs, b.max_abs);
    if (std::abs(difference) <= rounding) return 0;
    if (variance == 0) return std::copysign(kInf, difference);
    double t = std::abs(difference) / std::sqrt(variance + rounding * rounding);
    // Hall's transformation, for the skewness of the darker side, weighted by its share of the variance.
    const BlockSum& dark = difference < 0 ? a : b;
    if (dark.variance > 0) {
        const double g = std::pow(dark.variance / variance, 1.5) / std::sqrt(dark.events);
        t = std::max(0.0, std::min(t, t - g * t * t / 3 + g * g * t * t * t / 27 - g / 6));
    }
    const double dof = variance * variance / (a.dof_terms + b.dof_terms);
    // In this order: no degrees of freedom (one sample) leave t.
    return std::copysign(std::min(t, normal_tail_inverse(student_tail(t, dof))), difference);
}

/// Pools the variances of two images of one estimator, pixel by pixel.
void pool(Estimate& a, Estimate& b) {
    const double na = double(a.samples), nb = double(b.samples);
    for (size_t i = 0; i < a.mean.size(); ++i) {
        const double pooled =
            (a.variance_of_mean[i] * na * (na - 1) + b.variance_of_mean[i] * nb * (nb - 1)) / (na + nb - 2);
        a.variance_of_mean[i] = pooled / na;
        b.variance_of_mean[i] = pooled / nb;
    }
}

void check(const Estimate& e, const ZTestOptions& options, const char* name) {
    if (e.samples && e.samples < std::max<uint64_t>(options.min_samples, 2))
        throw Error(ExitCode::bad_input,
                    fmt::format("image {} has {} samples per pixel; the statistical comparison needs at least {}", name,
                                e.samples, std::max<uint64_t>(options.min_samples, 2)));
    const size_t size = size_t(e.width) * e.height * 3;
    if (size == 0 || e.mean.size() != size || e.variance_of_mean.size() != size)
        throw Error(ExitCode::bad_input, fmt::format("image {} is empty or its buffers do not fit its size", name));
}

/// Tests the blocks of two images, from the whole image to the smallest blocks.
class BlockTests {
public:
    BlockTests(const Estimate& a, const Estimate& b, const ZTestOptions& options)
        : a_(a), b_(b), options_(options), smallest_(std::max(1u, options.block)) {}

    ZTestResult run() {
        uint64_t size = smallest_;
        while (size < std::max(a_.width, a_.height)) size *= 2;
        Level level = test_level(size, nullptr);
        while (level.size > smallest_) level = test_level(level.size / 2, &level);
        conclude();
        return r_;
    }

private:
    struct Events {
        double per_pixel, expected;  ///< of the image that has fewer
    };
    /// Blocks of one size. The largest is the whole image.
    struct Level {
        uint64_t size;
        uint32_t columns, rows;
        std::vector<Events> events;  ///< by block and channel

        const Events& at(uint32_t column, uint32_t row, uint32_t channel) const {
            return events[(size_t(row) * columns + column) * 3 + channel];
        }
    };
    struct Block {
        Rectangle area;
        uint32_t channel;
        BlockSum a, b;
        double z;
        double pixels() const { return double(uint64_t(area.width) * area.height); }
        double fewest_events() const { return std::min(a.events, b.events); }
    };

    Level test_level(uint64_t size, const Level* parent) {
        Level level{size, uint32_t((a_.width + size - 1) / size), uint32_t((a_.height + size - 1) / size), {}};
        level.events.reserve(size_t(level.columns) * level.rows * 3);
        double count[3] = {0, 0, 0};
        for (uint32_t row = 0; row < level.rows; ++row)
            for (uint32_t column = 0; column < level.columns; ++column)
                for (uint32_t c = 0; c < 3; ++c) {
                    const Block block = measure_block(level, column, row, c);
                    // The larger block says how many events to expect here. What it expected itself is a bound, so that
                    // a block that happens to have met none does not overrule those around it.
                    double expected = kInf;
                    if (parent) {
                        const Events& around = parent->at(column / 2, row / 2, c);
                        expected = std::min(around.per_pixel * block.pixels(), around.expected);
                    }
                    level.events.push_back({block.fewest_events() / block.pixels(), expected});
                    if (!parent) add_whole(block);
                    if (!is_conclusive(block, expected, !parent)) {
                        r_.undecided = r_.undecided || !parent;
                        r_.inconclusive += size == smallest_;
                        continue;
                    }
                    ++r_.tests;
                    if (size == smallest_) {
                        r_.chi_square[c] += block.z * block.z;
                        ++count[c];
                    }
                    note_worst(block);
                }
        if (size == smallest_) test_smallest(count);
        return level;
    }

    Block measure_block(const Level& level, uint32_t column, uint32_t row, uint32_t channel) const {
        Block block{{uint32_t(column * level.size), uint32_t(row * level.size), 0, 0}, channel, {}, {}, 0};
        Rectangle& area = block.area;
        area.width = uint32_t(std::min<uint64_t>(level.size, a_.width - area.x));
        area.height = uint32_t(std::min<uint64_t>(level.size, a_.height - area.y));
        block.a = block_sum(a_, area, channel);
        block.b = block_sum(b_, area, channel);
        block.z = block_z(block.a, block.b, options_);
        return block;
    }

    void add_whole(const Block& block) {
        r_.mean_z[block.channel] = block.z;
        total_a_ += block.a.mean;
        total_b_ += block.b.mean;
        // Channels of a pixel may be fully correlated: deviations add.
        const double variance = block.a.variance + block.b.variance;
        deviation_ += std::sqrt(variance);
        if (variance > 0) dof_ = std::min(dof_, variance * variance / (block.a.dof_terms + block.b.dof_terms));
    }

    bool is_conclusive(const Block& block, double expected, bool whole) const {
        return block.z == 0 || std::isnan(block.a.mean + block.b.mean) ||
               (block.fewest_events() >= (whole ? 0.25 : 1.0) * options_.min_events &&
                expected >= 0.5 * options_.min_events);
    }

    void note_worst(const Block& block) {
        // Of infinite ones the smallest block is named.
        if (std::abs(block.z) > std::abs(r_.worst_z) || r_.worst_width == 0 ||
            (std::isinf(block.z) && std::isinf(r_.worst_z) && r_.worst_width > block.area.width)) {
            r_.worst_z = block.z;
            r_.worst_x = block.area.x;
            r_.worst_y = block.area.y;
            r_.worst_width = block.area.width;
            r_.worst_height = block.area.height;
            r_.worst_channel = block.channel;
            r_.worst_a = block.a.mean / block.pixels();
            r_.worst_b = block.b.mean / block.pixels();
        }
    }

    /// `count`: conclusive blocks of each channel.
    void test_smallest(const double (&count)[3]) {
        for (int c = 0; c < 3; ++c) {
            r_.chi_square_dof = std::max(r_.chi_square_dof, count[c]);
            if (count[c] > 0 && a_.batches.empty() && b_.batches.empty())
                r_.p_chi_square =
                    std::min(r_.p_chi_square, std::min(1.0, 3 * chi_square_tail(r_.chi_square[c], count[c])));
        }
    }

    void conclude() {
        r_.p_worst = r_.tests ? sidak(2 * normal_tail(std::abs(r_.worst_z)), double(r_.tests)) : 1;
        r_.relative_difference = total_a_ == total_b_ ? 0 : (total_a_ - total_b_) / total_b_;
        const double threshold = student_tail_inverse(
            0.5 * sidak_level(0.5 * options_.significance, std::max<double>(1, double(r_.tests))), dof_);
        r_.detectable = threshold * deviation_ / std::abs(total_b_);
        r_.pass = !r_.undecided && r_.p_worst >= 0.5 * options_.significance &&
                  r_.p_chi_square >= 0.5 * options_.significance;
    }

    const Estimate &a_, &b_;
    const ZTestOptions& options_;
    const uint32_t smallest_;
    ZTestResult r_;
    double total_a_ = 0, total_b_ = 0, deviation_ = 0;
    double dof_ = kInf;  ///< of the whole image: the fewest of the channels
};

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

Estimate to_estimate(const std::vector<FilmMoments>& batches) {
    if (batches.size() < 16)
        throw Error(
            ExitCode::bad_input,
            fmt::format("{} independent parts of an image are too few for the variances of its blocks; 16 are needed",
                        batches.size()));
    FilmMoments all = batches[0];
    for (size_t i = 1; i < batches.size(); ++i) {
        if (batches[i].samples != batches[0].samples || batches[i].sum.size() != all.sum.size())
            throw Error(ExitCode::bad_input,
                        fmt::format("part {} of an image has another size or sample count than the first", i));
        all.add(batches[i]);
    }
    Estimate e = to_estimate(all);
    for (const FilmMoments& b : batches) {
        e.batches.emplace_back(b.sum.size());
        for (size_t i = 0; i < b.sum.size(); ++i) e.batches.back()[i] = b.mean(i);
    }
    return e;
}

Estimate to_estimate(const Reference& r) {
    Estimate e = exact_estimate(r.mean);
    if (r.standard_error.rgb.empty()) return e;
    if (r.samples < 2) throw Error(ExitCode::bad_input, "the reference has standard errors but states no sample count");
    e.samples = r.samples;
    for (size_t i = 0; i < e.mean.size(); ++i)
        e.variance_of_mean[i] = double(r.standard_error.rgb[i]) * double(r.standard_error.rgb[i]);
    return e;
}

Estimate exact_estimate(const Image& image) {
    return {image.width, image.height, 0, std::vector<double>(image.rgb.begin(), image.rgb.end()),
            std::vector<double>(image.rgb.size())};
}

ZTestResult z_test(const Estimate& image_a, const Estimate& image_b, const ZTestOptions& options) {
    check(image_a, options, "a");
    check(image_b, options, "b");
    Estimate a = image_a, b = image_b;
    if (a.width != b.width || a.height != b.height)
        throw Error(ExitCode::bad_input,
                    fmt::format("images differ in size: {}x{} and {}x{}", a.width, a.height, b.width, b.height));
    if (options.same_estimator && a.samples && b.samples) pool(a, b);
    return BlockTests(a, b, options).run();
}

std::string ZTestResult::report() const {
    return fmt::format(
        "{}: worst block z = {:+.2f} (corrected p = {:.2g}) of {} tests\n"
        "  at {},{} size {}x{} channel {}: {:.6g} against {:.6g}\n"
        "  whole image z = {:+.2f} {:+.2f} {:+.2f}, relative difference {:+.3g} (would fail from {:.2g})\n"
        "  chi-square {:.1f} {:.1f} {:.1f} over {} blocks, corrected p = {:.2g}; {} smallest blocks left to larger "
        "ones{}",
        pass ? "pass" : "FAIL", worst_z, p_worst, tests, worst_x, worst_y, worst_width, worst_height,
        "RGB"[worst_channel], worst_a, worst_b, mean_z[0], mean_z[1], mean_z[2], relative_difference, detectable,
        chi_square[0], chi_square[1], chi_square[2], chi_square_dof, p_chi_square, inconclusive,
        undecided
            ? "\n  a channel has met too few bright samples in the whole image: nothing is shown, use more samples"
            : "");
}

MitsubaZTest mitsuba_z_test(const Image& mean, uint64_t spp, const Image& ref, const Image& ref_variance) {
    if (mean.width != ref.width || mean.height != ref.height || ref.width != ref_variance.width ||
        ref.height != ref_variance.height)
        throw Error(ExitCode::bad_input,
                    fmt::format("images differ in size: {}x{}, reference {}x{}, variance {}x{}", mean.width,
                                mean.height, ref.width, ref.height, ref_variance.width, ref_variance.height));
    // Linear Rec.709 to CIE XYZ (IEC 61966-2-1 with D65).
    constexpr double kToXyz[3][3] = {
        {0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169}, {0.019334, 0.119193, 0.950227}};
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
