#include "film/block_sums.h"

#include <algorithm>
#include <cmath>

namespace ambilux {
namespace {

/// The variance of a block whose pixels are not independent, from the sums of its batches. Events that several pixels
/// share are one.
void correlate(const Estimate& image, const Rectangle& r, uint32_t channel, BlockSum& side) {
    const double n = double(image.batches.size());
    double squares = 0;
    for (const std::vector<double>& batch : image.batches) {
        double sum = 0;
        for (uint32_t y = r.y; y < r.y + r.height; ++y)
            for (uint32_t x = r.x; x < r.x + r.width; ++x) sum += batch[(size_t(y) * image.width + x) * 3 + channel];
        squares += (sum - side.mean) * (sum - side.mean);
    }
    const double variance = squares / (n * (n - 1));
    if (variance > side.variance) side.events *= side.variance / variance;
    side.variance = variance;
    side.dof_terms = variance * variance / (n - 1);
}

}  // namespace

BlockSum block_sum(const Estimate& image, const Rectangle& r, uint32_t channel) {
    BlockSum side;
    double base = std::numeric_limits<double>::infinity();
    const auto index = [&](uint32_t x, uint32_t y) { return (size_t(y) * image.width + x) * 3 + channel; };
    for (uint32_t y = r.y; y < r.y + r.height; ++y)
        for (uint32_t x = r.x; x < r.x + r.width; ++x) {
            const double m = image.mean[index(x, y)];
            side.mean += m;
            side.max_abs += std::abs(m);
            base = std::min(base, m);
        }
    if (image.samples == 0) return side;
    const double n = double(image.samples);
    double concentration = 0;
    for (uint32_t y = r.y; y < r.y + r.height; ++y)
        for (uint32_t x = r.x; x < r.x + r.width; ++x) {
            const size_t i = index(x, y);
            const double v = image.variance_of_mean[i], above = image.mean[i] - base;
            if (v == 0) continue;
            side.variance += v;
            side.dof_terms += v * v / (n - 1);
            const double events = n * above * above / (v * n + above * above);
            concentration += v * v / std::max(1.0, events);  // no variance without at least one event
        }
    if (side.variance > 0) side.events = side.variance * side.variance / concentration;
    if (side.max_abs == 0) side.events = 0;  // black: it may have met no light yet
    if (!image.batches.empty()) correlate(image, r, channel, side);
    return side;
}

}  // namespace ambilux
