#include "backends/cuda/order.h"

#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include <algorithm>

#include "backends/cuda/device_memory.h"

namespace ambilux {
namespace {

__global__ void number_places(uint32_t* list, uint32_t slots) {
    for (uint32_t i = blockIdx.x * blockDim.x + threadIdx.x; i < slots; i += gridDim.x * blockDim.x) list[i] = i;
}

size_t select_bytes(uint32_t slots) {
    size_t bytes = 0;
    cuda_check(cub::DeviceSelect::Flagged(nullptr, bytes, thrust::counting_iterator<uint32_t>(0),
                                          static_cast<const uint8_t*>(nullptr), static_cast<uint32_t*>(nullptr),
                                          static_cast<uint32_t*>(nullptr), int(slots)),
               "memory of compaction");
    return bytes;
}

template <class Key>
size_t sort_bytes(uint32_t slots) {
    size_t bytes = 0;
    const Key* from = nullptr;
    Key* to = nullptr;
    cuda_check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, from, to, static_cast<const uint32_t*>(nullptr),
                                               static_cast<uint32_t*>(nullptr), int(slots)),
               "memory of sorting");
    return bytes;
}

template <class Key>
void sort_by(const OrderMemory& order, const Key* keys, uint32_t count, uint32_t bits, cudaStream_t stream) {
    size_t bytes = order.temporary_bytes;
    cuda_check(cub::DeviceRadixSort::SortPairs(order.temporary, bytes, keys, reinterpret_cast<Key*>(order.keys[1]),
                                               static_cast<const uint32_t*>(order.list[0]), order.list[1], int(count),
                                               0, int(bits), stream),
               "sorting");
}

}  // namespace

uint64_t order_temporary_bytes(QueuePolicy policy, uint32_t slots) {
    const bool lists = policy.compaction == Compaction::select || policy.ordering != Ordering::none;
    if (lists && slots > 0x7fffffffu)
        throw Error(ExitCode::usage,
                    "compaction=select and orderings work on at most 2147483647 paths at a time: leave them out, or "
                    "set a smaller wave_size or --size");
    size_t bytes = 0;
    if (policy.compaction == Compaction::select) bytes = select_bytes(slots);
    if (policy.ordering != Ordering::none)
        bytes = std::max({bytes, sort_bytes<uint16_t>(slots), sort_bytes<uint32_t>(slots)});
    return bytes;
}

void select_places(const OrderMemory& order, const uint8_t* flags, uint32_t capacity, uint32_t* count,
                   cudaStream_t stream) {
    size_t bytes = order.temporary_bytes;
    cuda_check(cub::DeviceSelect::Flagged(order.temporary, bytes, thrust::counting_iterator<uint32_t>(0), flags,
                                          order.list[0], count, int(capacity), stream),
               "compaction");
}

void list_places(const OrderMemory& order, cudaStream_t stream) {
    number_places<<<1024, 128, 0, stream>>>(order.list[0], order.slots);
    cuda_check(cudaGetLastError(), "places");
}

void sort_places(const OrderMemory& order, const uint16_t* keys, uint32_t count, uint32_t bits, cudaStream_t stream) {
    if (keys)
        sort_by(order, keys, count, bits, stream);
    else
        sort_by(order, static_cast<const uint32_t*>(order.keys[0]), count, bits, stream);
}

}  // namespace ambilux
