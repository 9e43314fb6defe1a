// PNG files to look at.
#pragma once

#include <string>

#include "film/image.h"

namespace ambilux {

/// sRGB transfer function (IEC 61966-2-1) of a linear value; clamps to [0,1].
float linear_to_srgb(float linear);

/// Writes 8-bit sRGB of `image` times 2^exposure; NaN becomes black. Atomic. Throws Error(device) if the file cannot be
/// written.
void write_png(const std::string& path, const Image& image, float exposure = 0.0f);

}  // namespace ambilux
