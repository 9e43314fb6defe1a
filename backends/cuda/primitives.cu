#include "backends/cuda/primitives.h"

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "backends/cuda/device_memory.h"

namespace ambilux {
namespace {

template <class Key>
size_t sort_bytes(uint32_t items) {
    size_t bytes = 0;
    cuda_check(
        cub::DeviceRadixSort::SortPairs(nullptr, bytes, static_cast<const Key*>(nullptr), static_cast<Key*>(nullptr),
                                        static_cast<const uint32_t*>(nullptr), static_cast<uint32_t*>(nullptr), items),
        "memory of sorting");
    return bytes;
}

uint64_t bytes_of_sort(uint32_t items, uint32_t key_bytes) {
    return key_bytes == 2   ? sort_bytes<uint16_t>(items)
           : key_bytes == 4 ? sort_bytes<uint32_t>(items)
                            : sort_bytes<uint64_t>(items);
}

uint64_t bytes_of_scan(uint32_t items) {
    size_t bytes = 0;
    cuda_check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, static_cast<const uint32_t*>(nullptr),
                                             static_cast<uint32_t*>(nullptr), items),
               "memory of sums");
    return bytes;
}

}  // namespace

PrimitiveBytes device_primitive_bytes() { return {bytes_of_sort, bytes_of_scan}; }

template <class Key>
void sort_pairs_on_device(const SortMemory<Key>& m, uint32_t items, uint32_t bits, cudaStream_t stream) {
    if (items == 0) return;
    size_t bytes = m.temporary_bytes;
    cuda_check(cub::DeviceRadixSort::SortPairs(m.temporary, bytes, static_cast<const Key*>(m.keys[0]), m.keys[1],
                                               static_cast<const uint32_t*>(m.values[0]), m.values[1], items, 0,
                                               int(bits), stream),
               "sorting");
}
template void sort_pairs_on_device(const SortMemory<uint16_t>&, uint32_t, uint32_t, cudaStream_t);
template void sort_pairs_on_device(const SortMemory<uint32_t>&, uint32_t, uint32_t, cudaStream_t);
template void sort_pairs_on_device(const SortMemory<uint64_t>&, uint32_t, uint32_t, cudaStream_t);

void scan_on_device(const ScanMemory& m, const uint32_t* in, uint32_t* out, uint32_t items, cudaStream_t stream) {
    if (items == 0) return;
    size_t bytes = m.temporary_bytes;
    cuda_check(cub::DeviceScan::ExclusiveSum(m.temporary, bytes, in, out, items, stream), "sums");
}

}  // namespace ambilux
