// What a few samples of a render itself say of its variance and time, for methods that no pilot predicts.
#pragma once

#include "render/renderer.h"
#include "render/selection.h"

namespace ambilux {

struct Measured {
    std::vector<double> variance;  ///< by block of the film: of one sample of a pixel, over the block's squared mean
                                   ///< plus 0.01, mean over pixels and channels
    double seconds = 0;            ///< of one sample of every pixel
};

/// From sample `first` on; the first of them bears what later ones do not and counts for no time.
Measured measure(const RenderSettings& settings, const MakeRenderer& make, uint32_t first);

/// Product of variance and time of b over that of a; the worst blocks are left out (trimmed_means).
double measured_ratio(const Measured& a, const Measured& b);

}  // namespace ambilux
