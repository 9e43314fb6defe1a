// Lists of places (queues/order.h) on a CUDA device. All calls only launch, so that they can be captured into a graph.
#pragma once

#include <cuda_runtime_api.h>

#include "queues/order.h"

namespace ambilux {

/// Bytes of OrderMemory::temporary.
uint64_t order_temporary_bytes(QueuePolicy policy, uint32_t slots);

/// Writes the places among `capacity` whose flag is set to order.list[0], in order, and their number to *count.
void select_places(const OrderMemory& order, const uint8_t* flags, uint32_t capacity, uint32_t* count,
                   cudaStream_t stream);

/// Has order.list[0] hold the places 0, 1, 2 ...
void list_places(const OrderMemory& order, cudaStream_t stream);

/// Sorts `count` places of order.list[0] by the lowest `bits` bits of their keys, `keys` or if it is null
/// order.keys[0], into order.list[1], equal keys in the order they have.
void sort_places(const OrderMemory& order, const uint16_t* keys, uint32_t count, uint32_t bits, cudaStream_t stream);

}  // namespace ambilux
