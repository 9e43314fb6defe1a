// Sorts and scans of a host (queues/primitives.h).
#pragma once

#include "queues/primitives.h"

namespace ambilux {

PrimitiveBytes host_primitive_bytes();

/// Sorts the first `items` pairs by the lowest `bits` bits of their keys, on the calling thread.
template <class Key>
void sort_pairs_alone(const SortMemory<Key>& m, uint32_t items, uint32_t bits);
/// The same on all threads of the current arena.
template <class Key>
void sort_pairs_together(const SortMemory<Key>& m, uint32_t items, uint32_t bits);
/// out[i] = in[0] + ... + in[i - 1], on all threads.
void scan_together(const uint32_t* in, uint32_t* out, uint32_t items);

}  // namespace ambilux
