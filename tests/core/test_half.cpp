// libs: ambilux_core Imath::Imath
// Half floats: every one of them, and the rounding of floats between; the same bits as Imath's.
#include "core/half.h"

#include <Imath/half.h>

#include <cmath>

#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("halves become floats exactly, by arithmetic and by the instruction alike") {
    for (uint32_t h = 0; h < 0x10000u; ++h) {
        const uint32_t exponent = h >> 10 & 31u, fraction = h & 1023u;
        if (exponent == 31) continue;
        const double magnitude = exponent ? std::ldexp(1024 + fraction, int(exponent) - 25) : std::ldexp(fraction, -24);
        const float expected = h & 0x8000u ? -float(magnitude) : float(magnitude);
        REQUIRE(float_bits(half_to_float(h)) == float_bits(expected));
        alignas(8) const uint16_t four[4] = {uint16_t(h), 0x3c00, uint16_t(h ^ 0x8000u), 1};
        const Vec4f v = load_half4(four);
        REQUIRE(float_bits(v.x) == float_bits(expected));
        REQUIRE(v.y == 1.0f);
        REQUIRE(float_bits(v.z) == float_bits(-expected));
        REQUIRE(v.w == 0x1p-24f);
        REQUIRE(float_to_half(expected) == h);
        REQUIRE(float_bits(imath_half_to_float(uint16_t(h))) == float_bits(expected));
    }
}

TEST_CASE("floats round to the nearest half, ties to even") {
    for (uint32_t h = 0; h < 0x7bffu; ++h) {
        const float a = half_to_float(h), b = half_to_float(h + 1), middle = 0.5f * (a + b);
        REQUIRE(float_to_half(next_float_down(middle)) == h);
        REQUIRE(float_to_half(middle) == h + (h & 1u));
        REQUIRE(float_to_half(next_float_up(middle)) == h + 1);
        REQUIRE(float_to_half(-next_float_up(middle)) == (h + 1 | 0x8000u));
        for (const float f : {next_float_down(middle), middle, next_float_up(middle), a + 0.25f * (b - a)})
            REQUIRE(float_to_half(f) == imath_float_to_half(f));
    }
    CHECK(float_to_half(0x1p-30f) == 0);
    CHECK(float_to_half(kMaxHalf) == 0x7bff);
}
