// Reading images from files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/vec.h"
#include "formats/limits.h"

namespace ambilux {

/// RGBA texels of an image file, row 0 at the top. 8-bit files keep their bytes, as stored (not linearised); all others
/// are floats. Files with one or two channels are spread to grey; missing alpha is 1.
struct Texels {
    uint32_t width = 0, height = 0;
    bool is_8bit = false;
    bool is_linear = false;          ///< EXR and HDR; otherwise values are sRGB-encoded unless the scene says different
    std::vector<uint8_t> bytes;      ///< 4 per texel if is_8bit
    std::vector<float> floats;       ///< 4 per texel otherwise
    std::vector<std::string> notes;  ///< what the file says of itself that is followed in our own way, or not at all

    /// Number `i` of all, bytes as parts of 255.
    double stored(size_t i) const { return is_8bit ? bytes[i] / 255.0 : double(floats[i]); }
    /// Colour of a texel, decoded as the format of the file implies.
    Rgb linear(size_t texel) const;
};

/// How stored values become linear ones: gamma 1 linear, -1 sRGB, other values a power.
double decoded(double value, double gamma);

/// Decodes PNG (libpng), JPEG (libjpeg-turbo), EXR (OpenEXR, data window), HDR, PNM (P5, P6,
/// PF), BMP or TGA. The format follows from the content. Throws Error(bad_input) with `path`, also for what is beyond
/// the limits, before it is allocated.
Texels read_image(const std::string& path, std::string_view bytes, const Limits& limits = {});

}  // namespace ambilux
