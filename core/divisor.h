// Division by a number that only the host knows ahead.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "core/rng.h"

namespace ambilux {

/// A number, and quotients by it with a multiplication (Granlund and Montgomery 1994, "Division by Invariant Integers
/// using Multiplication", figure 4.1).
class Divisor {
public:
    Divisor() = default;
    /// `value` >= 1.
    Divisor(uint32_t value) : value_(value) {
        const uint32_t bits = uint32_t(std::bit_width(value - 1));
        factor_ = uint32_t((((uint64_t(1) << bits) - value) << 32) / value + 1);
        first_shift_ = std::min(bits, 1u);
        second_shift_ = bits - first_shift_;
    }
    AMBILUX_HD operator uint32_t() const { return value_; }
    /// n / value, for any n.
    AMBILUX_HD uint32_t quotient(uint32_t n) const {
        const uint32_t high = mul_hi(factor_, n);
        return (high + ((n - high) >> first_shift_)) >> second_shift_;
    }

private:
    uint32_t value_ = 1, factor_ = 1, first_shift_ = 0, second_shift_ = 0;
};

}  // namespace ambilux
