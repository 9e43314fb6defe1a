// Do two images have the same expectation? The one statistical comparison that image tests use.
#pragma once

#include <string>

#include "film/image.h"

namespace ambilux {

/// An image as a random variable: means, their variances, samples per pixel. Values as in FilmMoments.
struct Estimate {
    uint32_t width = 0, height = 0;
    uint64_t samples = 0;  ///< 0: exactly known means (all variances zero)
    std::vector<double> mean, variance_of_mean;
    /// Means of independent parts of equal weight, for images whose pixels are not independent of each other (one light
    /// subpath splats onto many): the variance of a block then comes from the parts. Empty: pixels are independent.
    std::vector<std::vector<double>> batches = {};
};

/// Throws Error(bad_input) with fewer than two samples, which have no variance.
Estimate to_estimate(const FilmMoments& moments);
/// An image whose pixels depend on each other, from independent parts of equal sample counts. Throws Error(bad_input)
/// for fewer than 16 parts or unequal ones.
Estimate to_estimate(const std::vector<FilmMoments>& batches);
/// A reference without standard errors counts as exactly known.
Estimate to_estimate(const Reference& reference);
/// Exactly known image, such as a closed form.
Estimate exact_estimate(const Image& image);

struct ZTestOptions {
    uint32_t block = 8;          ///< pixels along the side of the smallest blocks
    double significance = 1e-3;  ///< chance that two equal expectations fail
    uint64_t min_samples = 16;   ///< per pixel; fewer are refused, since variances mean little then
    double min_events =
        32;  ///< random events that a block must have met on both sides to be tested; the whole image needs a quarter
    double rounding = 4e-6;  ///< relative difference that is put down to float rounding
    /// Both images come from the same estimator (say, on two backends): their variances are pooled, which guards
    /// against rare bright samples that only one of them has met.
    bool same_estimator = false;
};

struct ZTestResult {
    bool pass = false;
    uint64_t tests = 0;  ///< blocks × channels on all levels that were tested
    uint64_t inconclusive =
        0;                   ///< blocks × channels of the smallest size with too few events; larger blocks cover them
    bool undecided = false;  ///< a channel had met too few events even as a whole; then pass is false
    double worst_z = 0;      ///< normal equivalent, signed: positive if `a` is brighter
    uint32_t worst_x = 0, worst_y = 0, worst_width = 0, worst_height = 0, worst_channel = 0;  ///< block in pixels
    double worst_a = 0, worst_b = 0;                                                          ///< block means
    double p_worst = 1;              ///< chance that the worst of so many tests is as bad (Sidak)
    double mean_z[3] = {0, 0, 0};    ///< whole image, per channel
    double relative_difference = 0;  ///< (mean(a)-mean(b))/mean(b) over all pixels and channels
    double detectable =
        0;  ///< relative difference of the overall mean that would just have failed (Student's t): the test's power
    double chi_square[3] = {0, 0, 0};  ///< sum of z² over the smallest blocks, per channel
    double chi_square_dof = 0;         ///< largest count of blocks of a channel
    double p_chi_square = 1;           ///< smallest of the channels' tails, corrected for three
    std::string report() const;        ///< several lines for a person
};

/// Compares block means on all scales: blocks of `block` pixels, of twice that size and so on up to the whole image,
/// each channel by itself.
///
/// A block's t = (mean a - mean b)/sqrt(sum of variances of both), with its variances from the moments and
/// Welch-Satterthwaite degrees of freedom; t becomes its normal equivalent z. Of an image with batches, whose pixels
/// may be correlated, the block's variance is that of its mean over the batches; since blocks then depend on each other
/// too, the chi-square is only reported. The level is shared by the worst z (Sidak over all blocks, channels and
/// scales; scales overlap, which only makes this stricter on itself) and by the chi-square of z² over the smallest
/// blocks, which sees many small differences.
///
/// Heavy tails: a block that has met few of its rare bright samples is too dark and its variance is estimated too small
/// together, so that plain z-scores fail for correct images. Two guards. The number of events that made a block's
/// variance is estimated (see block_sum(); N rare equal hits give N); a block is tested only if it has met
/// `min_events` on both sides and its share of the events in the block of twice its size is half as many. Larger blocks
/// reach that, so missing light cannot hide on every scale. And the skewness 1/sqrt(events) is taken out of t (Hall
/// 1992, "On the removal of skewness by transformation") where that makes |t| smaller. What neither guard can see is a
/// bright sample so rare that it never occurred anywhere: an image of too few samples. The caller chooses enough, and
/// `detectable` says what the test could see.
///
/// Pixels of zero variance must agree up to `rounding`. A NaN or Inf fails. Throws Error(bad_input) if sizes differ or
/// samples are too few.
ZTestResult z_test(const Estimate& a, const Estimate& b, const ZTestOptions& options = {});

struct MitsubaZTest {
    bool pass = false;
    double passed_fraction = 0;  ///< of pixels × channels
    double worst_z = 0;
    uint32_t worst_x = 0, worst_y = 0, worst_channel = 0;
};

/// The rule of Mitsuba 3's render tests: in XYZ, per pixel and channel z = |mean-ref|·sqrt(spp/max(var,1e-4)),
/// two-sided p above the Sidak level of 0.01 over the pixels, for at least 99.75 % of the values. `ref_variance` is
/// that of one sample; all images are linear Rec.709, converted from XYZ.
MitsubaZTest mitsuba_z_test(const Image& mean, uint64_t spp, const Image& ref, const Image& ref_variance);

}  // namespace ambilux
