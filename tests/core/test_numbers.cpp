// libs: ambilux_core
// Small functions of numbers (core/vec.h).
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "core/vec.h"
#include "tests/support/catch.h"

TEST_CASE("min and max are exact for integers that no float tells apart") {
    const uint32_t a = (1u << 24) + 1, b = (1u << 25) + 3;
    static_assert(std::is_same_v<decltype(ambilux::min(a, b)), uint32_t>);
    CHECK(ambilux::min(a, b) == a);
    CHECK(ambilux::min(b, a) == a);
    CHECK(ambilux::max(a, a + 1) == a + 1);
    CHECK(ambilux::max(b, b - 1) == b);
    CHECK(ambilux::min(0xffffffffu, 0xfffffffeu) == 0xfffffffeu);
    CHECK(ambilux::max(-5, 3) == 3);
    CHECK(ambilux::min(1.0 + 1e-12, 2.0) == 1.0 + 1e-12);
}

TEST_CASE("min and max of a number and a NaN are the number") {
    const float nan = std::nanf("");
    CHECK(ambilux::min(nan, 2.0f) == 2.0f);
    CHECK(ambilux::min(2.0f, nan) == 2.0f);
    CHECK(ambilux::max(nan, 2.0f) == 2.0f);
    CHECK(ambilux::max(2.0f, nan) == 2.0f);
    CHECK(ambilux::min(1.0f, 2.0f) == 1.0f);
    CHECK(ambilux::max(1.0f, 2.0f) == 2.0f);
}
