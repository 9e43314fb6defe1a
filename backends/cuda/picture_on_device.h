// Pictures of a film that lies on a device, tone mapped there.
#pragma once

#include <memory>
#include <vector>

#include "backends/cuda/device_memory.h"
#include "film/tone.h"

namespace ambilux {

/// Memory of the host that a device writes to.
class PinnedBytes {
public:
    explicit PinnedBytes(uint64_t bytes) : bytes_(bytes) {
        cuda_check(cudaMallocHost(reinterpret_cast<void**>(&data_), bytes), "a picture in memory of the host");
    }
    ~PinnedBytes() { cudaFreeHost(data_); }
    PinnedBytes(const PinnedBytes&) = delete;
    PinnedBytes& operator=(const PinnedBytes&) = delete;

    uint8_t* data() { return data_; }
    uint64_t bytes() const { return bytes_; }

private:
    uint64_t bytes_;
    uint8_t* data_ = nullptr;
};

class PicturesOnDevice {
public:
    /// What it holds on the device.
    static constexpr uint64_t kBytes = kToneSteps;

    /// As tone_mapped. `sum`: on the current device; nothing may write to it meanwhile. The device writes what is shown
    /// straight into memory of the host, which is taken again once nobody holds the picture. Throws Error(device).
    ByteImage make(const double* sum, uint32_t width, uint32_t height, uint64_t samples, float stops);

private:
    std::shared_ptr<PinnedBytes> unused(uint64_t bytes);

    DeviceBuffer<uint8_t> table_;
    std::vector<std::shared_ptr<PinnedBytes>> buffers_;
};

}  // namespace ambilux
