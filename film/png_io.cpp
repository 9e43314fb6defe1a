#include "film/png_io.h"

#include <png.h>

#include <cmath>

#include "core/atomic_file.h"
#include "core/error.h"

namespace ambilux {

float linear_to_srgb(float linear) {
    if (!(linear > 0.0f)) return 0.0f;
    if (linear >= 1.0f) return 1.0f;
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

void write_png(const std::string& path, const Image& image, float exposure) {
    const float scale = std::exp2(exposure);
    std::vector<uint8_t> pixels(image.rgb.size());
    for (size_t i = 0; i < pixels.size(); ++i)
        pixels[i] = uint8_t(std::lround(255.0f * linear_to_srgb(scale * image.rgb[i])));
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = image.width;
    png.height = image.height;
    png.format = PNG_FORMAT_RGB;
    std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
    png_alloc_size_t size = bytes.size();
    if (!png_image_write_to_memory(&png, bytes.data(), &size, 0, pixels.data(), 0, nullptr))
        throw Error(ExitCode::device, "cannot write " + path + ": " + png.message);
    bytes.resize(size);
    write_file_atomic(path, bytes);
}

}  // namespace ambilux
