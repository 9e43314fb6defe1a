#include "film/png_io.h"

#include <cmath>

#include "core/atomic_file.h"
#include "core/error.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wshadow"
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

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
    std::string bytes;
    const auto collect = [](void* target, void* data, int size) {
        static_cast<std::string*>(target)->append(static_cast<char*>(data), size_t(size));
    };
    if (!stbi_write_png_to_func(collect, &bytes, int(image.width), int(image.height), 3, pixels.data(),
                                int(image.width) * 3))
        throw Error(ExitCode::device, "cannot write " + path + ": PNG encoding failed");
    write_file_atomic(path, bytes);
}

}  // namespace ambilux
