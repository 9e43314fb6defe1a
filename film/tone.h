// Pictures to look at: sRGB of 8 bits.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>

#include "core/hd.h"

namespace ambilux {

/// Three bytes a pixel, row by row from the top left.
struct ByteImage {
    uint32_t width = 0, height = 0;
    uint64_t samples = 0;  ///< per pixel
    std::shared_ptr<const uint8_t> rgb;

    size_t bytes() const { return size_t(width) * height * 3; }
};

constexpr uint32_t kToneSteps = 4096;

/// sRGB in 8 bits of the square of i / (kToneSteps - 1): steps are even where the eye sees them.
const std::array<uint8_t, kToneSteps>& tone_table();

/// From a sum over samples to the byte that is shown. Host and device have the same.
struct ToneMap {
    const uint8_t* table;  ///< tone_table(), where this runs
    double scale;

    AMBILUX_HD uint8_t operator()(double sum) const {
        const double value = sum * scale;
        // NaN fails the comparison and is black.
        const double root = value > 0 ? sqrt(value < 1.0 ? value : 1.0) : 0.0;
        return table[uint32_t(root * double(kToneSteps - 1) + 0.5)];
    }
};

/// What sums are multiplied with: 2^stops over the number of samples.
double tone_scale(float stops, uint64_t samples);

/// The mean of `sum`, three values a pixel, times 2^stops.
ByteImage tone_mapped(const double* sum, uint32_t width, uint32_t height, uint64_t samples, float stops);

}  // namespace ambilux
