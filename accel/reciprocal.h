// Reciprocals that are the same on host and device.
#pragma once

#include "core/hd.h"
#include "core/math.h"

namespace ambilux {

/// 1/x correctly rounded for x of ordinary size: on a device without the branch for the rest (Markstein 1990,
/// "Computation of elementary functions on the IBM RISC System/6000 processor").
AMBILUX_HD float ordinary_reciprocal(float x) {
#if defined(__CUDA_ARCH__)
    float r;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(x));
    return fmaf(r, fmaf(-x, r, 1.0f), r);
#else
    return 1.0f / x;
#endif
}

}  // namespace ambilux
