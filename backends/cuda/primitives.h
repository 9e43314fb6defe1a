// Sorts and scans of a CUDA device (queues/primitives.h), by CUB. All calls only launch.
#pragma once

#include <cuda_runtime_api.h>

#include "queues/primitives.h"

namespace ambilux {

PrimitiveBytes device_primitive_bytes();

/// Sorts the first `items` pairs by the lowest `bits` bits of their keys (16, 32 or 64 bits).
template <class Key>
void sort_pairs_on_device(const SortMemory<Key>& m, uint32_t items, uint32_t bits, cudaStream_t stream);
/// out[i] = in[0] + ... + in[i - 1].
void scan_on_device(const ScanMemory& m, const uint32_t* in, uint32_t* out, uint32_t items, cudaStream_t stream);

}  // namespace ambilux
