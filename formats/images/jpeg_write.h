// JPEG files in memory, made by all threads.
#pragma once

#include <cstdint>
#include <string>

namespace ambilux {

/// Sides of a JPEG in pixels.
constexpr uint32_t kLargestJpeg = 65500;

/// The bytes of a baseline JPEG (ITU-T T.81) of 8 bits, values as they are. `rgb`: 3 per pixel, top row first.
/// `quality`: 1 to 100; colours are stored for every second pixel of every second row. Throws Error(device), and
/// Error(usage) if a side is 0 or longer than kLargestJpeg.
std::string jpeg_bytes(uint32_t width, uint32_t height, const uint8_t* rgb, int quality);

}  // namespace ambilux
