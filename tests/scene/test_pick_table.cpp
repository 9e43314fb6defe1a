// libs: ambilux_scene
// timeout: 60
// Tables by which emitters and triangles are picked: shares of random floats are whole, positive and in proportion.
#include "scene/pick_table.h"

#include <cmath>
#include <numeric>

#include "core/sampling.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// Weights of n entries: equal, random, mostly zero, over many orders of magnitude, or one that dwarfs the rest.
std::vector<double> weights_of(uint32_t n, int kind) {
    std::vector<double> w;
    w.reserve(n);
    for (uint32_t i = 0; i < n; ++i) {
        const Vec4f u = random_floats({n, i, uint32_t(kind), Stream::test}, 0);
        const double values[] = {3.0, double(u.x), u.x < 0.9f ? 0.0 : double(u.y),
                                 std::pow(10.0, 30 * double(u.x) - 15), i == n / 2 ? 1e12 : 1.0};
        w.push_back(values[kind]);
    }
    return w;
}

}  // namespace

TEST_CASE("pick tables: steps are whole tickets, positive where weights are, and what sampling draws") {
    for (uint32_t n : {1u, 2u, 3u, 1000u, 300000u, 5000000u})
        for (int kind = 0; kind < 5; ++kind) {
            if (kind > 0 && n > 300000) continue;
            const std::vector<double> weights = weights_of(n, kind);
            const std::vector<float> cdf = pick_table(weights);
            REQUIRE(cdf.size() == n + 1);
            CHECK(cdf[0] == 0.0f);
            CHECK(cdf[n] == 1.0f);
            const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
            const double dealt = double(count_picks(weights)) * 0x1p-24;
            int wrong = 0;
            for (uint32_t i = 0; i < n; ++i) {
                const double p = double(cdf[i + 1]) - cdf[i];
                wrong += p * 0x1p24 != std::floor(p * 0x1p24) || p != double(cdf[i + 1] - cdf[i]);
                if (total > 0) {
                    wrong += (p > 0) != (weights[i] > 0);
                    const double expected = weights[i] > 0 ? (1 - dealt) * weights[i] / total + 0x1p-24 : 0;
                    wrong += std::abs(p - expected) > 0x1.0p-24;
                }
                // The first and the last random float of the entry's share.
                if (p > 0) wrong += sample_cdf(cdf.data(), n, cdf[i]) != i;
                if (p > 0) wrong += sample_cdf(cdf.data(), n, cdf[i + 1] - 0x1p-24f) != i;
            }
            INFO(n << " weights of kind " << kind);
            CHECK(wrong == 0);
        }
}

TEST_CASE("pick tables: as many entries as there are random floats get one each; black ones share equally") {
    const std::vector<float> full = pick_table(weights_of(1u << 24, 4));
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < 1u << 24; ++i) wrong += full[i + 1] - full[i] != 0x1p-24f;
    CHECK(wrong == 0);
    CHECK(pick_table({0, 0}) == std::vector<float>{0.0f, 0.5f, 1.0f});
    CHECK(pick_table({0, 1e-300, 0}) == std::vector<float>{0.0f, 0.0f, 1.0f, 1.0f});
    CHECK(count_picks({0, 2, 0, 1e-300}) == 2);
    CHECK(count_picks({0, 0, 0}) == 3);
}
