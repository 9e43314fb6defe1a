// Sums over a block of an image with what is known of their chance: for comparisons of block means.
#pragma once

#include <limits>

#include "film/ztest.h"

namespace ambilux {

/// One image in one block and channel.
struct BlockSum {
    double mean = 0;                                          ///< sum of the pixels' means
    double variance = 0;                                      ///< sum of their variances
    double dof_terms = 0;                                     ///< sum of v²/(n-1), for Welch-Satterthwaite
    double max_abs = 0;                                       ///< sum of absolute means
    double events = std::numeric_limits<double>::infinity();  ///< random events that made the variance; see block_sum()
};

struct Rectangle {
    uint32_t x, y, width, height;
};

/// Sums over a block, and how many events its variance comes from. A pixel of n samples with mean m and sample variance
/// s² above a base b, which no event made bright, has e = n(m-b)²/(s²+(m-b)²) effective ones (Kish 1965): rare equal
/// hits count one each. The base is the darkest mean in the block. Pixels add up weighted by their share of the
/// variance, so that N rare hits anywhere give N.
BlockSum block_sum(const Estimate& image, const Rectangle& r, uint32_t channel);

}  // namespace ambilux
