// The image of a film that lies on a device, made there.
#pragma once

#include <vector>

#include "film/device_image.h"

namespace ambilux {

/// The same bits as mean_image of the film. `sum`: on the current device, three values a pixel; nothing may write to it
/// meanwhile. Throws Error(device).
DeviceImage mean_on_device(const double* sum, uint32_t width, uint32_t height, uint64_t samples);

/// Copies the image to `rgb`, whose memory stays if it is of this size already. Throws Error(device).
void copy_to_host(const DeviceImage& image, std::vector<float>& rgb);

}  // namespace ambilux
