#include "backends/cuda/picture_on_device.h"

#include <atomic>

namespace ambilux {
namespace {

/// A thread writes four bytes, so that a warp writes whole lines over the bus.
__global__ void map_tones(const double* sum, uint32_t* words, uint64_t values, ToneMap tone) {
    for (uint64_t i = blockIdx.x * uint64_t(blockDim.x) + threadIdx.x; i < (values + 3) / 4;
         i += uint64_t(gridDim.x) * blockDim.x) {
        uint32_t word = 0;
        for (uint32_t k = 0; k < 4; ++k)
            if (4 * i + k < values) word |= uint32_t(tone(sum[4 * i + k])) << (8 * k);
        words[i] = word;
    }
}

}  // namespace

std::shared_ptr<PinnedBytes> PicturesOnDevice::unused(uint64_t bytes) {
    for (std::shared_ptr<PinnedBytes>& b : buffers_) {
        if (b.use_count() > 1) continue;
        std::atomic_thread_fence(std::memory_order_acquire);  // what its last reader did came before
        if (b->bytes() != bytes) b = std::make_shared<PinnedBytes>(bytes);
        return b;
    }
    return buffers_.emplace_back(std::make_shared<PinnedBytes>(bytes));
}

ByteImage PicturesOnDevice::make(const double* sum, uint32_t width, uint32_t height, uint64_t samples, float stops) {
    const uint64_t values = uint64_t(width) * height * 3;
    if (table_.size() == 0) table_ = DeviceBuffer<uint8_t>(tone_table(), "tone table");
    const std::shared_ptr<PinnedBytes> pinned = unused((values + 3) / 4 * 4);
    map_tones<<<1024, 256>>>(sum, reinterpret_cast<uint32_t*>(pinned->data()), values,
                             {table_.data(), tone_scale(stops, samples)});
    cuda_check(cudaGetLastError(), "picture");
    wait_for_default_stream("picture");
    return {width, height, samples, {pinned, pinned->data()}};
}

}  // namespace ambilux
