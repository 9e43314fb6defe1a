// Sums of light in fixed point: they do not depend on the order in which threads add.
#pragma once

#include "core/atomic.h"
#include "core/warp.h"

namespace ambilux {

/// One unit of the sums: a pixel holds up to 6.7e7 in steps of 1.5e-11.
constexpr double kLightUnit = 0x1p-36;

/// Values from here on look at the sum that they are added to: below, a pixel would have to meet 2^20 of them to wrap
/// around.
constexpr float kLargeLight = 64.0f;

/// Light from here on is too much to be added.
constexpr float kTooMuchLight = 0x1p26f;

struct FixedLight {
    int64_t value[3];

    AMBILUX_HD static FixedLight of(Rgb v) {
        return {{llrint(double(v.x) / kLightUnit), llrint(double(v.y) / kLightUnit), llrint(double(v.z) / kLightUnit)}};
    }
    AMBILUX_HD Rgb rgb() const {
        return {float(double(value[0]) * kLightUnit), float(double(value[1]) * kLightUnit),
                float(double(value[2]) * kLightUnit)};
    }
};

/// Adds up what the lanes have, values of less than 2^42: true for the one that is left with the sum.
AMBILUX_HD bool gather_light([[maybe_unused]] SameKey lanes, [[maybe_unused]] FixedLight& light) {
#if defined(__CUDA_ARCH__)
    if (lanes.several()) {
        constexpr uint32_t kHalf = (1u << 21) - 1;
        for (int c = 0; c < 3; ++c) {
            const uint32_t low = __reduce_add_sync(lanes.lanes, uint32_t(light.value[c]) & kHalf);
            const uint32_t high = __reduce_add_sync(lanes.lanes, uint32_t(light.value[c] >> 21));
            light.value[c] = (int64_t(high) << 21) + low;
        }
        return lanes.is_first();
    }
#endif
    return true;
}

/// Adds a large value, unless the sum could wrap around some time: then false.
AMBILUX_HD bool add_large_fixed(int64_t* sum, int64_t value) {
    const int64_t before = fetch_add_shared(sum, value);
    if (before >= 0 && before < (int64_t(1) << 62) - value) return true;
    fetch_add_shared(sum, -value);
    return false;
}

/// Adds light to three sums. False if it does not fit: such light is to be counted as infinite, not wrapped.
AMBILUX_HD bool add_light(int64_t* sums, Rgb value) {
    const float most = max_component(value);
    if (!(most < kTooMuchLight)) return false;
    FixedLight fixed = FixedLight::of(value);
    if (most < kLargeLight) {
        if (gather_light(same_key(reinterpret_cast<uintptr_t>(sums)), fixed))
            for (int c = 0; c < 3; ++c) fetch_add_shared(sums + c, fixed.value[c]);
        return true;
    }
    bool fits = true;
    for (int c = 0; c < 3; ++c) fits = add_large_fixed(sums + c, fixed.value[c]) && fits;
    return fits;
}

}  // namespace ambilux
