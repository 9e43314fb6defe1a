#include "backends/cuda/host_texels.h"

#include <algorithm>
#include <cstring>

#include "backends/cuda/device_memory.h"

namespace ambilux {
namespace {

#if CUDART_VERSION >= 13000
const cudaMemLocation kHost = {cudaMemLocationTypeHost, 0};
#else
constexpr int kHost = cudaCpuDeviceId;
#endif

void advise(const uint8_t* data, uint64_t bytes, cudaMemoryAdvise advice) {
    cuda_check(cudaMemAdvise(data, bytes, advice, kHost), "textures in host memory");
}

int current_device() {
    int device = 0;
    cuda_check(cudaGetDevice(&device), "device");
    return device;
}

std::shared_ptr<uint8_t> managed(std::span<const uint8_t> texels) {
    int pages_on_demand = 0;
    cuda_check(cudaDeviceGetAttribute(&pages_on_demand, cudaDevAttrConcurrentManagedAccess, current_device()),
               "managed memory");
    if (!pages_on_demand)
        throw Error(ExitCode::device,
                    "this device cannot fetch pages of the host when it needs them: use --textures pinned");
    uint8_t* data = nullptr;
    cuda_check(cudaMallocManaged(reinterpret_cast<void**>(&data), texels.size()), "textures in host memory",
               texels.size());
    std::shared_ptr<uint8_t> owned(data, [](uint8_t* p) { cudaFree(p); });
    std::memcpy(data, texels.data(), texels.size());
    // Pages on a device are copies: the driver drops them without writing back, and several devices can have the same.
    advise(data, texels.size(), cudaMemAdviseSetPreferredLocation);
    advise(data, texels.size(), cudaMemAdviseSetReadMostly);
    return owned;
}

std::shared_ptr<uint8_t> pinned(std::span<const uint8_t> texels) {
    void* data = nullptr;
    cuda_check(cudaHostAlloc(&data, texels.size(), cudaHostAllocPortable | cudaHostAllocMapped),
               "textures in pinned host memory", texels.size());
    std::shared_ptr<uint8_t> owned(static_cast<uint8_t*>(data), [](uint8_t* p) { cudaFreeHost(p); });
    std::memcpy(data, texels.data(), texels.size());
    return owned;
}

}  // namespace

HostTexels::HostTexels(std::span<const uint8_t> texels, TextureMemory where) : where_(where), bytes_(texels.size()) {
    if (bytes_ == 0) return;
    data_ = where == TextureMemory::pinned ? pinned(texels) : managed(texels);
}

void HostTexels::drop() const {
    if (where_ == TextureMemory::pinned || bytes_ == 0) return;
    // Copies are merged into the one at the preferred location.
    advise(data(), bytes_, cudaMemAdviseUnsetReadMostly);
    advise(data(), bytes_, cudaMemAdviseSetReadMostly);
}

void HostTexels::prefetch(cudaStream_t stream) const {
    if (where_ == TextureMemory::pinned) return;
    const uint64_t free = free_device_bytes(), room = free - std::min(free, kLeftFree), bytes = std::min(bytes_, room);
    if (bytes == 0) return;
#if CUDART_VERSION >= 13000
    const cudaMemLocation here = {cudaMemLocationTypeDevice, current_device()};
    cuda_check(cudaMemPrefetchAsync(data(), bytes, here, 0, stream), "prefetch of textures");
#else
    cuda_check(cudaMemPrefetchAsync(data(), bytes, current_device(), stream), "prefetch of textures");
#endif
    cuda_check(cudaStreamSynchronize(stream), "prefetch of textures");
}

}  // namespace ambilux
