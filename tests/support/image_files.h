// Image files made in memory. Tests that include it link JPEG::JPEG.
#pragma once

// jpeglib.h needs FILE.
#include <cstdio>

#include <jpeglib.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "formats/images/image_write.h"

namespace ambilux::test {

inline std::string jpeg_file(uint32_t width, uint32_t height, std::vector<uint8_t> rgb, bool progressive = false) {
    jpeg_compress_struct info;
    jpeg_error_mgr errors;
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    unsigned char* data = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&info, &data, &size);
    info.image_width = width;
    info.image_height = height;
    info.input_components = 3;
    info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 95, TRUE);
    if (progressive) jpeg_simple_progression(&info);
    jpeg_start_compress(&info, TRUE);
    for (uint32_t y = 0; y < height; ++y) {
        JSAMPROW row = &rgb[size_t(y) * width * 3];
        jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
    std::string bytes(reinterpret_cast<char*>(data), size);
    jpeg_destroy_compress(&info);
    std::free(data);
    return bytes;
}

/// The 18 bytes before the pixels: `type` 2 for colours, 10 for runs of them.
inline std::string tga_header(uint32_t type, uint32_t width, uint32_t height, uint32_t bits, uint32_t descriptor = 0) {
    std::string h(18, '\0');
    h[2] = char(type);
    h[12] = char(width), h[13] = char(width >> 8), h[14] = char(height), h[15] = char(height >> 8);
    h[16] = char(bits), h[17] = char(descriptor);
    return h;
}

inline std::string hdr_header(uint64_t width, uint64_t height) {
    return "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(height) + " +X " + std::to_string(width) + "\n";
}

/// Red, green, blue with a common exponent.
inline std::string rgbe(float r, float g, float b) {
    int exponent = 0;
    const float most = std::max(r, std::max(g, b)), scale = std::frexp(most, &exponent) * 256.0f / most;
    return {char(uint8_t(r * scale)), char(uint8_t(g * scale)), char(uint8_t(b * scale)),
            char(uint8_t(exponent + 128))};
}

}  // namespace ambilux::test
