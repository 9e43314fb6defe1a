// Sums of light in fixed point: they do not depend on the order in which threads add.
#pragma once

#include "core/vec.h"

namespace ambilux {

/// One unit of the sums: a pixel holds up to 6.7e7 in steps of 1.5e-11.
constexpr double kLightUnit = 0x1p-36;

AMBILUX_HD void add_fixed(int64_t* sum, int64_t value) {
#if defined(__CUDA_ARCH__)
    atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(value));
#else
    __atomic_fetch_add(sum, value, __ATOMIC_RELAXED);
#endif
}

/// Values from here on look at the sum that they are added to: below, a pixel would have to meet 2^20 of them to wrap around.
constexpr float kLargeLight = 64.0f;

/// Adds a large value, unless the sum could wrap around some time: then false.
AMBILUX_HD bool add_large_fixed(int64_t* sum, int64_t value) {
#if defined(__CUDA_ARCH__)
    const auto before = static_cast<int64_t>(atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(value)));
#else
    const int64_t before = __atomic_fetch_add(sum, value, __ATOMIC_RELAXED);
#endif
    if (before >= 0 && before < (int64_t(1) << 62) - value) return true;
    add_fixed(sum, -value);
    return false;
}

/// Adds light to three sums. False if it does not fit: such light is to be counted as infinite, not wrapped.
AMBILUX_HD bool add_light(int64_t* sums, Rgb value) {
    if (!(max_component(value) < 0x1p26f)) return false;
    bool fits = true;
    for (int c = 0; c < 3; ++c) {
        const int64_t fixed = llrint(double(value[c]) / kLightUnit);
        if (value[c] < kLargeLight)
            add_fixed(sums + c, fixed);
        else
            fits = add_large_fixed(sums + c, fixed) && fits;
    }
    return fits;
}

}  // namespace ambilux
