// libs: ambilux_core
// Shuffled, Owen-scrambled Sobol' points (core/sobol.h).
#include "core/sobol.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/support/catch.h"

using namespace ambilux;

namespace {

using Words = std::array<uint32_t, kSobolDimensions>;
Words words(Uint4 v) { return {v.x, v.y, v.z, v.w}; }

Words sample(uint32_t pixel, uint32_t index, uint32_t block, uint64_t seed = 1, Stream stream = Stream::eye) {
    return words(SobolPoints::bits({seed, pixel, index, stream}, block));
}

/// True if each of the 2^m cells, 2^a of them along dimension `i` and the others along `j`, has one of the 2^m points.
bool one_in_each_cell(const std::vector<Words>& points, uint32_t m, uint32_t a, uint32_t i, uint32_t j) {
    std::vector<uint8_t> met(points.size());
    for (const Words& p : points) {
        const uint64_t row = uint64_t(p[i]) >> (32 - a), column = uint64_t(p[j]) >> (32 - (m - a));
        if (met[row << (m - a) | column]++) return false;
    }
    return true;
}

/// Correlation of two lists of numbers.
double correlation(const std::vector<double>& a, const std::vector<double>& b) {
    const double n = double(a.size());
    double ma = 0, mb = 0, ab = 0, aa = 0, bb = 0;
    for (size_t i = 0; i < a.size(); ++i) {
        ma += a[i] / n;
        mb += b[i] / n;
    }
    for (size_t i = 0; i < a.size(); ++i) {
        ab += (a[i] - ma) * (b[i] - mb);
        aa += (a[i] - ma) * (a[i] - ma);
        bb += (b[i] - mb) * (b[i] - mb);
    }
    return ab / std::sqrt(aa * bb);
}

}  // namespace

TEST_CASE("unscrambled points are the published Sobol' sequence of Joe and Kuo") {
    // In the order of Gray codes, as their program prints them; in 1/16.
    constexpr uint32_t kPublished[16][kSobolDimensions] = {
        {0, 0, 0, 0},    {8, 8, 8, 8},    {12, 4, 4, 4}, {4, 12, 12, 12}, {6, 6, 10, 14}, {14, 14, 2, 6},
        {10, 2, 14, 10}, {2, 10, 6, 2},   {3, 5, 15, 7}, {11, 13, 7, 15}, {15, 1, 11, 3}, {7, 9, 3, 11},
        {5, 3, 5, 9},    {13, 11, 13, 1}, {9, 7, 1, 13}, {1, 15, 9, 5}};
    for (uint32_t k = 0; k < 16; ++k) {
        INFO(k);
        Words expected;
        for (uint32_t d = 0; d < kSobolDimensions; ++d) expected[d] = kPublished[k][d] << 28;
        CHECK(words(sobol_point(k ^ k >> 1)) == expected);
    }
}

TEST_CASE("direction numbers follow from the published ones") {
    // m_1, m_2, ... of the file new-joe-kuo-6.21201 (1; 1, 3; 1, 3, 1), and what their recurrence makes of them.
    const std::array<std::vector<uint32_t>, 3> kPublished = {
        {{1, 3, 5, 15, 17, 51, 85, 255}, {1, 3, 3, 9, 29, 23, 71, 197}, {1, 3, 1, 5, 31, 29, 81, 147}}};
    for (uint32_t d = 1; d < kSobolDimensions; ++d)
        for (uint32_t i = 0; i < kPublished[d - 1].size(); ++i) {
            INFO(d << " " << i);
            CHECK(sobol_directions(d)[i] == kPublished[d - 1][i] << (31 - i));
        }
}

TEST_CASE("the samples of a pixel are nets: aligned blocks of 2^m meet every elementary interval once") {
    for (const uint32_t pixel : {0u, 7u, 123456u})
        for (uint32_t m = 1; m <= 10; ++m)
            for (const uint32_t first : {0u, 1u << m, 6u << m}) {
                std::vector<Words> points;
                for (uint32_t i = 0; i < 1u << m; ++i) points.push_back(sample(pixel, first + i, 3));
                INFO("pixel " << pixel << ", m " << m << ", first " << first);
                for (uint32_t a = 1; a < m; ++a) CHECK(one_in_each_cell(points, m, a, 0, 1));
                for (uint32_t d = 0; d < kSobolDimensions; ++d) CHECK(one_in_each_cell(points, m, m, d, d));
            }
}

TEST_CASE("the light subpaths of a film are one net") {
    constexpr uint32_t m = 12;
    std::vector<Words> points;
    for (uint32_t i = 0; i < 1u << m; ++i) points.push_back(words(SobolPoints::bits(light_point_key(5, i), 1)));
    for (uint32_t a = 1; a < m; ++a) CHECK(one_in_each_cell(points, m, a, 0, 1));
    for (uint32_t d = 0; d < kSobolDimensions; ++d) CHECK(one_in_each_cell(points, m, m, d, d));
    // Those of one pixel, one in each sample of a film of 64 pixels, do not keep to one part of an emitter.
    std::vector<uint32_t> eighths(8);
    for (uint32_t s = 0; s < 512; ++s) ++eighths[SobolPoints::bits(light_point_key(5, 64 * s + 9), 0).x >> 29];
    for (const uint32_t count : eighths) CHECK(count > 32);
}

TEST_CASE("points of one decision are members of their sample's part of one set") {
    // Four draws of each of 16 samples are 64 points of a net.
    std::vector<Words> points;
    for (uint32_t s = 0; s < 16; ++s)
        for (uint32_t i = 0; i < 4; ++i) points.push_back(words(SobolPoints::bits({1, 2, s, Stream::eye}, 9, i, 4)));
    for (uint32_t a = 1; a < 6; ++a) CHECK(one_in_each_cell(points, 6, a, 0, 1));
}

TEST_CASE("sets beyond 2^32 points have other scrambles") {
    const uint64_t many = uint64_t(1) << 32;
    CHECK(words(SobolPoints::bits(light_point_key(1, 5), 0)) !=
          words(SobolPoints::bits(light_point_key(1, many + 5), 0)));
    CHECK(sample(3, 1u << 30, 0) != words(SobolPoints::bits({1, 3, 1u << 30, Stream::eye}, 0, 0, 4)));
}

TEST_CASE("scrambles of other pixels, blocks, streams and seeds are uncorrelated") {
    constexpr uint32_t kCount = 4096;
    const auto numbers = [](uint32_t d, auto point) {
        std::vector<double> list(kCount);
        for (uint32_t k = 0; k < kCount; ++k) list[k] = point(k)[d];
        return list;
    };
    // Of one sample in many pixels, so that lists are of independent numbers; 5 standard deviations.
    const double bound = 5 / std::sqrt(double(kCount));
    for (uint32_t index = 0; index < 4; ++index)
        for (uint32_t d = 0; d < kSobolDimensions; ++d) {
            const auto here = numbers(d, [&](uint32_t k) { return sample(k, index, 4); });
            INFO("sample " << index << ", dimension " << d);
            CHECK(std::abs(correlation(here, numbers(d, [&](uint32_t k) { return sample(k + 1, index, 4); }))) < bound);
            CHECK(std::abs(correlation(here, numbers(d, [&](uint32_t k) { return sample(k, index, 5); }))) < bound);
            CHECK(std::abs(correlation(here, numbers(d, [&](uint32_t k) { return sample(k, index, 4, 2); }))) < bound);
            CHECK(std::abs(correlation(
                      here, numbers(d, [&](uint32_t k) { return sample(k, index, 4, 1, Stream::bench); }))) < bound);
            for (uint32_t e = 0; e < d; ++e)
                CHECK(std::abs(correlation(here, numbers(e, [&](uint32_t k) { return sample(k, index, 4); }))) < bound);
        }
}

TEST_CASE("over pixels every sample is uniform in each dimension and in pairs of them") {
    constexpr uint32_t kCount = 1 << 16, kCells = 16;
    // Chi-square with 255 degrees of freedom: mean 255, deviation 22.6.
    for (const uint32_t index : {0u, 1u, 5u, 1000u})
        for (uint32_t d = 0; d < kSobolDimensions; ++d)
            for (uint32_t e = 0; e < d; ++e) {
                std::vector<uint32_t> counts(kCells * kCells);
                for (uint32_t k = 0; k < kCount; ++k) {
                    const Words p = sample(k, index, 2);
                    ++counts[(p[d] >> 28) * kCells + (p[e] >> 28)];
                }
                double chi = 0;
                const double mean = double(kCount) / (kCells * kCells);
                for (const uint32_t c : counts) chi += (c - mean) * (c - mean) / mean;
                INFO("sample " << index << ", dimensions " << d << " and " << e << ", chi-square " << chi);
                CHECK(chi < 255 + 5 * 22.6);
                CHECK(chi > 255 - 5 * 22.6);
            }
}

TEST_CASE("means of scrambled points are unbiased and vary less than those of independent ones") {
    // E[x y] = 1/4, and the area below x + y = 1.
    constexpr uint32_t kSeeds = 4000;
    for (const uint32_t n : {16u, 64u, 256u})
        for (const int which : {0, 1}) {
            double sum = 0, squares = 0;
            for (uint32_t seed = 0; seed < kSeeds; ++seed) {
                double mean = 0;
                for (uint32_t i = 0; i < n; ++i) {
                    const Words p = sample(77, i, 5, seed);
                    const double x = p[0] * 0x1p-32, y = p[1] * 0x1p-32;
                    mean += (which ? double(x + y < 1) : x * y) / n;
                }
                sum += mean;
                squares += mean * mean;
            }
            const double mean = sum / kSeeds, variance = squares / kSeeds - mean * mean;
            const double expected = which ? 0.5 : 0.25, independent = (which ? 0.25 : 7.0 / 144) / n;
            INFO(n << " points, function " << which << ", mean " << mean << ", variance over that of independent ones "
                   << variance / independent);
            CHECK(std::abs(mean - expected) < 5 * std::sqrt(variance / kSeeds));
            CHECK(variance < independent * 2 / std::sqrt(double(n)));
        }
}
