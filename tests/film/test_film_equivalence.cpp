// libs: ambilux_film
// Images that are the same to the eye, of known expectations.
#include <random>

#include "core/error.h"
#include "film/equivalence.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

constexpr uint32_t kWidth = 64, kHeight = 40;

/// An image whose means have normal errors of `deviation`; the left half brighter by `left`, everything by `all`.
Estimate image(uint64_t seed, double deviation, double all = 1, double left = 1) {
    std::mt19937_64 rng(seed);
    std::normal_distribution<double> normal;
    Estimate e{kWidth, kHeight, 1024, {}, {}};
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x)
            for (uint32_t c = 0; c < 3; ++c) {
                const double mean = (1 + c + 0.01 * y) * all * (x < kWidth / 2 ? left : 1);
                e.mean.push_back(mean + deviation * normal(rng));
                e.variance_of_mean.push_back(deviation * deviation);
            }
    return e;
}

int shown(int runs, double deviation, double all, double left) {
    int count = 0;
    for (int i = 0; i < runs; ++i)
        count += equivalence(image(2 * uint64_t(i), deviation, all, left), image(2 * uint64_t(i) + 1, deviation)).shown;
    return count;
}

}  // namespace

TEST_CASE("images of one expectation are equivalent once there are enough samples, and not before") {
    CHECK(shown(50, 0.005, 1, 1) >= 48);
    CHECK(shown(50, 0.5, 1, 1) == 0);
    const Equivalence e = equivalence(image(1, 0.005), image(2, 0.005));
    CHECK(e.level == 0.05);
    CHECK(e.mean_bound < 1e-3);
    CHECK(e.block_bound < 1e-2);
}

TEST_CASE("a difference that nobody could see is no reason to refuse, though a test finds it") {
    const Estimate a = image(1, 0.001, 1.0004), b = image(2, 0.001);
    CHECK_FALSE(z_test(a, b).pass);
    CHECK(equivalence(a, b).shown);
}

TEST_CASE("images that differ by the margin are called equivalent no more often than the level says") {
    // 100 runs at 5 %: more than 14 have a chance of 1e-4.
    CHECK(shown(100, 0.02, 1.001, 1) <= 14);
    CHECK(shown(100, 0.02, 1, 1.0204) <= 14);  // 1 % in one half, and in the mean half of a percent
}

TEST_CASE("a block that is off is named") {
    Estimate a = image(1, 0.001);
    const Estimate b = image(2, 0.001);
    for (uint32_t y = 32; y < kHeight; ++y)
        for (uint32_t x = 32; x < kWidth; ++x) a.mean[(size_t(y) * kWidth + x) * 3] *= 1.05;
    const Equivalence e = equivalence(a, b);
    CHECK_FALSE(e.shown);
    CHECK(e.worst_x == 32);
    CHECK(e.worst_y == 32);
    // Of the block's mean over its channels: 5 % of a channel that holds a sixth.
    CHECK(e.block_bound == Approx(0.05 / 2).epsilon(0.2));
}

TEST_CASE("where few events were met nothing is shown, and sizes must be equal") {
    Estimate a = image(1, 0.001), b = image(2, 0.001);
    // One bright pixel holds the variance of its block.
    a.variance_of_mean[0] = 1;
    a.mean[0] += 1;
    CHECK_FALSE(equivalence(a, b).shown);
    b.width = 32;
    CHECK_THROWS_AS(equivalence(a, b), Error);
}
