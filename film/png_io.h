// PNG files to look at.
#pragma once

#include <string>

#include "film/image.h"

namespace ambilux {

/// Writes 8-bit sRGB of `image` times 2^exposure; NaN becomes black. Atomic. Throws Error(device) if the file cannot be
/// written.
void write_png(const std::string& path, const Image& image, float exposure = 0.0f);

}  // namespace ambilux
