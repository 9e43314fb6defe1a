// What samples of a render itself say of its variance and time: of methods that no pilot predicts, and of those that a
// pilot cannot tell apart.
#pragma once

#include "render/renderer.h"
#include "render/selection.h"

namespace ambilux {

struct Measured {
    std::vector<double> variance;  ///< by block of the film: of one sample of a pixel, over the block's squared mean
                                   ///< plus 0.01, mean over pixels and channels
    double seconds = 0;            ///< of one sample of every pixel
    double samples = 0;            ///< of every pixel
};

/// From sample `first` on, for `seconds` but four samples at least; the first of them bears what later ones do not and
/// counts for no time.
Measured measure(const RenderSettings& settings, const MakeRenderer& make, uint32_t first, double seconds);

}  // namespace ambilux
