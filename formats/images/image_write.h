// Writing images that scenes name.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace ambilux {

/// OpenEXR with channels R, G and B as 32-bit floats. `rgb`: 3 per pixel. Throws Error(device).
void write_float_image(const std::string& path, uint32_t width, uint32_t height, const std::vector<float>& rgb);
/// The bytes of a PNG of 8 bits, values as they are. `rgb`: 3 per pixel, top row first. Throws Error(device).
std::string png_bytes(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgb);
/// The same as a file. Throws Error(device).
void write_byte_image(const std::string& path, uint32_t width, uint32_t height, const std::vector<uint8_t>& rgb);

}  // namespace ambilux
