#include "film/png_io.h"

#include <cmath>

#include "core/srgb.h"
#include "formats/images/image_write.h"

namespace ambilux {

void write_png(const std::string& path, const Image& image, float exposure) {
    const float scale = std::exp2(exposure);
    std::vector<uint8_t> pixels(image.rgb.size());
    for (size_t i = 0; i < pixels.size(); ++i)
        pixels[i] = uint8_t(std::lround(255.0f * linear_to_srgb(scale * image.rgb[i])));
    write_byte_image(path, image.width, image.height, pixels);
}

}  // namespace ambilux
