// Lanes of 16 bytes, of which arrays that threads read side by side are made.
#pragma once

#include <cstdint>
#include <cstring>

#include "core/hd.h"

namespace ambilux {

/// The unit of storage: one coalesced access per thread.
struct alignas(16) Lane {
    uint32_t word[4];
};

/// The start of a lane as a value. The lane is loaded whole: copying a part of it is compiled to loads of single bytes.
template <class Value>
AMBILUX_HD Value start_of(const Lane& place) {
    static_assert(sizeof(Value) <= sizeof(Lane));
    const Lane lane = place;
    Value value;
    memcpy(&value, &lane, sizeof(value));
    return value;
}

/// Replaces a lane by `value` and zeros.
template <class Value>
AMBILUX_HD void set_start(Lane& place, const Value& value) {
    Lane lane = {};
    memcpy(&lane, &value, sizeof(value));
    place = lane;
}

}  // namespace ambilux
