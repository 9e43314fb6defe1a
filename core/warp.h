// Threads that go through a loop together.
#pragma once

#include <cstdint>

#include "core/hd.h"

namespace ambilux {

/// On a device the lanes of a warp that are active where this is made; on the host the calling thread alone. All of
/// them must make the same calls.
struct Warp {
#if defined(__CUDA_ARCH__)
    uint32_t lanes = __activemask();

    /// Lanes that have left each other go on together.
    __device__ void meet() const { __syncwarp(lanes); }
    /// For how many lanes `b` is true.
    __device__ uint32_t count(bool b) const { return uint32_t(__popc(__ballot_sync(lanes, b))); }
#else
    void meet() const {}
    uint32_t count(bool b) const { return b; }
#endif
};

}  // namespace ambilux
