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

/// Values from here on look at the sum that they are added to: below, a pixel would have to meet 2^20 of them to wrap
/// around.
constexpr float kLargeLight = 64.0f;

/// Adds a large value, unless the sum could wrap around some time: then false.
AMBILUX_HD bool add_large_fixed(int64_t* sum, int64_t value) {
#if defined(__CUDA_ARCH__)
    const auto before = static_cast<int64_t>(
        atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(value)));
#else
    const int64_t before = __atomic_fetch_add(sum, value, __ATOMIC_RELAXED);
#endif
    if (before >= 0 && before < (int64_t(1) << 62) - value) return true;
    add_fixed(sum, -value);
    return false;
}

/// Light from here on is too much to be added.
constexpr float kTooMuchLight = 0x1p26f;

struct FixedLight {
    int64_t value[3];
};

AMBILUX_HD FixedLight to_fixed(Rgb value) {
    return {{llrint(double(value.x) / kLightUnit), llrint(double(value.y) / kLightUnit),
             llrint(double(value.z) / kLightUnit)}};
}

/// The threads of a warp that come with the same `key`, as bits. A lamp that covers a few pixels gets a splat from
/// every light walk.
template <class Key>
AMBILUX_HD uint32_t threads_with([[maybe_unused]] Key key) {
#if defined(__CUDA_ARCH__)
    return __match_any_sync(__activemask(), key);
#else
    return 1;
#endif
}
AMBILUX_HD bool several(uint32_t threads) { return threads & (threads - 1); }

/// These threads add up what they have, values of less than 2^42: true for the one that is left with the sum.
AMBILUX_HD bool gather_light([[maybe_unused]] uint32_t threads, [[maybe_unused]] FixedLight& light) {
#if defined(__CUDA_ARCH__)
    if (several(threads)) {
        constexpr uint32_t kHalf = (1u << 21) - 1;
        for (int c = 0; c < 3; ++c) {
            const uint32_t low = __reduce_add_sync(threads, uint32_t(light.value[c]) & kHalf),
                           high = __reduce_add_sync(threads, uint32_t(light.value[c] >> 21));
            light.value[c] = (int64_t(high) << 21) + low;
        }
        return (threadIdx.x & 31u) == uint32_t(__ffs(int(threads)) - 1);
    }
#endif
    return true;
}

/// Adds light to three sums. False if it does not fit: such light is to be counted as infinite, not wrapped.
AMBILUX_HD bool add_light(int64_t* sums, Rgb value) {
    const float most = max_component(value);
    if (!(most < kTooMuchLight)) return false;
    FixedLight fixed = to_fixed(value);
    if (most < kLargeLight) {
        if (gather_light(threads_with(reinterpret_cast<uintptr_t>(sums)), fixed))
            for (int c = 0; c < 3; ++c) add_fixed(sums + c, fixed.value[c]);
        return true;
    }
    bool fits = true;
    for (int c = 0; c < 3; ++c) fits = add_large_fixed(sums + c, fixed.value[c]) && fits;
    return fits;
}

}  // namespace ambilux
