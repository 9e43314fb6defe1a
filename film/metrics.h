// Error of an image against a reference.
#pragma once

#include <nlohmann/json.hpp>

#include "film/image.h"

namespace ambilux {

/// Share of the pixels that relmse_trimmed leaves out.
constexpr double kTrimmedShare = 0.001;

/// Means run over all pixels and the channels R, G, B; x is the image, r the reference, se the standard error of r.
struct Metrics {
    double rmse = 0;    ///< sqrt(mean((x-r)²)): holds the noise of the reference too
    double relmse = 0;  ///< mean((x-r)²/(r²+0.01))
    double mape = 0;    ///< mean(|x-r|/(|r|+0.01))
    /// The noise of the reference, sqrt(mean(se²)); NaN if the reference states no standard errors.
    double reference_noise = 0;
    /// sqrt(max(0, mean((x-r)² - se²))). With x independent of r and r unbiased, E[(x-r)²] = E[(x-truth)²] + se², so
    /// this estimates the error against the truth. NaN without standard errors. The samples of x and r must not share
    /// random numbers.
    double rmse_corrected = 0;
    double relmse_corrected = 0;  ///< max(0, mean(((x-r)²-se²)/(r²+0.01))); NaN without standard errors
    /// relMSE without the worst kTrimmedShare of all pixels: e_p = mean over the channels of (x-r)²/(r²+0.01), and the
    /// mean of e_p over all pixels but the floor(kTrimmedShare · pixels) largest. On scenes with fireflies a handful of
    /// pixels decides relMSE, so that its value says little about the image and changes from seed to seed; this figure
    /// ranks methods by what the rest of the image looks like (trimmed mean: Tukey 1962; Huber 1981). It is no estimate
    /// of relMSE: energy that a method finds only in outliers is not in it, so state it beside relMSE, never instead.
    /// NaN if any value of the image is NaN or Inf.
    double relmse_trimmed = 0;
    /// max(0, mean over the same pixels of ((x-r)²-se²)/(r²+0.01)); NaN without standard errors. Which pixels are kept
    /// depends on the noise of the reference as well, so where that noise and not the image's decides the worst pixels,
    /// this subtracts slightly too much.
    double relmse_trimmed_corrected = 0;
    double bias = 0;           ///< mean(x-r)
    double relative_bias = 0;  ///< mean(x-r)/mean(r); 0 for a black reference without bias
    /// Sum of the pixels' d over the root of the sum of d², where d is the mean over the channels of x-r. Under "no
    /// bias" pixels are independent with mean zero and this is close to standard normal, whatever their variances; it
    /// needs no variance of the image. Heavy tails make it small, never large. 0 if x equals r.
    double bias_z = 0;
    uint64_t non_finite =
        0;  ///< values of the image that are NaN or Inf; they make the figures NaN or Inf, never silently better
};

/// Throws Error(bad_input) if the sizes differ.
Metrics compare_images(const Image& image, const Reference& reference);

/// The same with exact (double) means.
Metrics compare_images(const FilmMoments& image, const Reference& reference);

/// Agreement with an image that states no errors, such as a published rendering.
struct BlockAgreement {
    double relative_mean = 0;  ///< (mean(x)-mean(r))/mean(r), over all pixels and channels
    double within = 0;  ///< share of blocks whose mean (over pixels and channels) lies within the relative tolerance of
                        ///< the reference's
    uint32_t worst_x = 0, worst_y = 0;  ///< pixel where the worst block begins
    double worst = 0;                   ///< its relative difference
};

/// Blocks of `block`x`block` pixels, smaller at the right and bottom edges; black reference blocks agree only with
/// black ones. Throws Error(bad_input) if the sizes differ.
BlockAgreement block_agreement(const Image& image, const Image& reference, uint32_t block = 16,
                               double tolerance = 0.03);

/// All fields under their names; NaN and Inf become null.
nlohmann::json to_json(const Metrics& metrics);

}  // namespace ambilux
