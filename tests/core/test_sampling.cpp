// libs: ambilux_core
// Warps from the unit square against their formulas in double precision.
#include <algorithm>
#include <cmath>

#include "core/sampling.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("sine and cosine of an octant are right to rounding") {
    double worst = 0;
    for (int i = -100000; i <= 100000; ++i) {
        const float x = kPiOver4 * float(i) / 100000.0f;
        float s, c;
        sin_cos_octant(x, s, c);
        worst = std::max({worst, std::abs(s - std::sin(double(x))), std::abs(c - std::cos(double(x)))});
    }
    CHECK(worst < 1e-7);
}

TEST_CASE("sine and cosine of turns are right to rounding, and exact at quarters") {
    double worst = 0;
    for (int i = 0; i <= 1 << 20; ++i) {
        const float t = float(i) / (1 << 20);
        float s, c;
        sin_cos_turns(t, s, c);
        const double angle = 2 * std::acos(-1.0) * double(t);
        worst = std::max({worst, std::abs(s - std::sin(angle)), std::abs(c - std::cos(angle))});
    }
    CHECK(worst < 1.5e-7);
    const float exact[5][2] = {{0, 1}, {1, 0}, {0, -1}, {-1, 0}, {0, 1}};
    for (int k = 0; k < 5; ++k) {
        float s, c;
        sin_cos_turns(0.25f * float(k), s, c);
        CHECK(s == exact[k][0]);
        CHECK(c == exact[k][1]);
    }
}

TEST_CASE("the concentric map is that of Shirley and Chiu") {
    double worst = 0;
    for (int i = 0; i <= 512; ++i) {
        for (int j = 0; j <= 512; ++j) {
            const Vec2f u = {float(i) / 512, float(j) / 512};
            const double a = 2.0 * u.x - 1, b = 2.0 * u.y - 1, quarter = std::acos(-1.0) / 4;
            double r = 0, phi = 0;
            if (std::abs(a) > std::abs(b))
                r = a, phi = quarter * (b / a);
            else if (b != 0)
                r = b, phi = 2 * quarter - quarter * (a / b);
            const Vec2f d = square_to_disk(u);
            worst = std::max({worst, std::abs(d.x - r * std::cos(phi)), std::abs(d.y - r * std::sin(phi))});
            CHECK(d.x * d.x + d.y * d.y <= 1.0f + 1e-6f);
        }
    }
    CHECK(worst < 3e-7);
}
