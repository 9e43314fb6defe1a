// Are two images so near each other that nobody could see the difference? The opposite question to that of ztest.h,
// which finds any difference if it has enough samples.
#pragma once

#include "film/ztest.h"

namespace ambilux {

struct EquivalenceOptions {
    double mean = 1e-3;      ///< relative difference of the whole image's means, from which on one could see it
    double block = 1e-2;     ///< the same of a block, in each channel, relative to the block's mean over its channels
    uint32_t size = 32;      ///< pixels along the side of a block
    double floor = 0.1;      ///< a block darker than this share of the image's mean is measured by that share of it
    double level = 0.05;     ///< chance of calling images equivalent that differ by so much or more
    double min_events = 32;  ///< random events that a block must have met on both sides; else nothing is shown
};

struct Equivalence {
    bool shown = false;
    double level = 0;
    double mean_bound = 0, block_bound = 0;  ///< relative differences of mean and worst block that the level allows
    uint32_t worst_x = 0, worst_y = 0;       ///< of that block
};

/// Two one-sided tests (Schuirmann 1987) of the whole image and of each block and channel, from the variances of both
/// images. Equivalence is shown where all of them show it: an intersection-union test, which has the level of each of
/// them (Berger 1982). Throws Error(bad_input) if sizes differ.
Equivalence equivalence(const Estimate& a, const Estimate& b, const EquivalenceOptions& options = {});

}  // namespace ambilux
