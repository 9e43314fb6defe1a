#include "backends/cuda/mean_on_device.h"

#include "backends/cuda/device_memory.h"

namespace ambilux {
namespace {

__global__ void divide(const double* sum, float* mean, uint64_t values, double samples) {
    for (uint64_t i = blockIdx.x * uint64_t(blockDim.x) + threadIdx.x; i < values;
         i += uint64_t(gridDim.x) * blockDim.x)
        mean[i] = float(sum[i] / samples);
}

}  // namespace

DeviceImage mean_on_device(const double* sum, uint32_t width, uint32_t height, uint64_t samples) {
    const uint64_t values = uint64_t(width) * height * 3;
    const auto buffer = std::make_shared<DeviceBuffer<float>>(values, "image on the device");
    if (samples == 0)
        buffer->zero();
    else
        divide<<<1024, 256>>>(sum, buffer->data(), values, double(samples));
    cuda_check(cudaGetLastError(), "image on the device");
    wait_for_default_stream("image on the device");
    DeviceImage image = {0, width, height, samples, {buffer, buffer->data()}};
    cuda_check(cudaGetDevice(&image.device), "device");
    return image;
}

void copy_to_host(const DeviceImage& image, std::vector<float>& rgb) {
    rgb.resize(size_t(image.width) * image.height * 3);
    cuda_check(cudaMemcpy(rgb.data(), image.rgb.get(), rgb.size() * sizeof(float), cudaMemcpyDeviceToHost),
               "image from the device");
}

}  // namespace ambilux
