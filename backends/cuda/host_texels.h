// Textures that a device reads from the host's memory.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <memory>
#include <span>

#include "scene/texture_memory.h"

namespace ambilux {

/// A copy of all texels for every device of the process. With TextureMemory::host the driver copies pages to a device
/// that touches them, and drops there the ones that were not used for longest when memory is wanted for others or for
/// buffers: its cache of tiles. With TextureMemory::pinned every access that misses the device's cache goes over the
/// bus.
class HostTexels {
public:
    /// Throws Error(device) if the current device cannot do that.
    HostTexels(std::span<const uint8_t> texels, TextureMemory where);

    /// For device and host.
    const uint8_t* data() const { return data_.get(); }
    uint64_t bytes() const { return bytes_; }
    /// Drops the pages that devices have, which then tell as free what buffers can have. They come again when they are
    /// touched.
    void drop() const;
    /// Copies to the current device what its free memory holds beside kLeftFree: one large copy takes less time than
    /// pages that are asked for one by one.
    void prefetch(cudaStream_t stream) const;

private:
    static constexpr uint64_t kLeftFree = 512 << 20;  ///< for what the driver allocates later
    TextureMemory where_;
    uint64_t bytes_;
    std::shared_ptr<uint8_t> data_;
};

}  // namespace ambilux
