// An image in the memory of a CUDA device.
#pragma once

#include <cstdint>
#include <memory>

namespace ambilux {

/// Means of pixels, float32 of height x width x 3, row by row from the top left. Nothing that was begun on the device
/// writes to it any more. It frees itself, from whichever thread, also after the renderer is gone.
struct DeviceImage {
    int device = 0;  ///< its number for CUDA
    uint32_t width = 0, height = 0;
    uint64_t samples = 0;  ///< per pixel
    std::shared_ptr<float> rgb;
};

}  // namespace ambilux
