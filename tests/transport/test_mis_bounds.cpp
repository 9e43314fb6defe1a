// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// Norms and sums of weights against long doubles, whose powers do not leave their range.
#include <cmath>
#include <cstdio>

#include "tests/support/bounds.h"
#include "tests/support/catch.h"
#include "transport/mis/bidirectional.h"

using namespace ambilux;
using namespace ambilux::bounds;

namespace {

using Long = long double;

constexpr MisHeuristic kHeuristics[] = {MisHeuristic::balance, MisHeuristic::power};

Long power(MisHeuristic h, Long x) { return h == MisHeuristic::power ? x * x : x; }
Long root(MisHeuristic h, Long x) { return h == MisHeuristic::power ? std::sqrt(x) : x; }

}  // namespace

TEST_CASE("B28: norms are right to 5 roundings from 1e-38 to 1e38, with zeros and infinities") {
    Numbers numbers(1);
    std::vector<float> values = {0x1p-126f, 0x1.fffffep126f, 1, kOneMinusEpsilon};
    for (int i = 0; i < 1500; ++i) values.push_back(numbers.magnitude(-37, 37.8f));
    for (const MisHeuristic h : kHeuristics) {
        Worst worst;
        for (const float a : values)
            for (const float b : values) {
                const Long truth = root(h, power(h, a) + power(h, b));
                worst.add(std::fabs(double((Long(heuristic_norm(h, a, b)) - truth) / truth)), 5 * kUnit);
            }
        std::printf("norm: %.2f of the bound\n", worst.share);
        CHECK(worst.share <= 1);
        for (const float a : values) {
            REQUIRE(heuristic_norm(h, a, 0.0f) == a);
            REQUIRE(heuristic_norm(h, 0.0f, a) == a);
            REQUIRE(heuristic_norm(h, a, kInfinity) == kInfinity);
        }
        CHECK(heuristic_norm(h, 0.0f, 0.0f) == 0.0f);
        CHECK(heuristic_norm(h, kInfinity, kInfinity) == kInfinity);
        // Subnormal numbers: to the last of their digits.
        CHECK(std::fabs(heuristic_norm(h, 1e-45f, 1e-45f) - 1e-45f) <= 2.9e-45f);
    }
}

namespace {

/// What a subpath meets at a vertex.
struct Step {
    float d2, cos_in, cos_out, forward, reverse;
    bool delta;
};

/// Every strategy's term at the last vertex, summed by themselves: the product of the quotients of densities along the
/// subpath from the vertex where connecting would end to the last one.
struct TrueSums {
    Long dvcm, dvc;
};

TrueSums true_sums(const BidirectionalMis& mis, MisSums start, const std::vector<Step>& steps) {
    // dvcm at each vertex.
    std::vector<Long> dvcm(steps.size());
    for (size_t i = 0; i < steps.size(); ++i) {
        const Long before = i == 0 ? Long(start.dvcm) : steps[i - 1].delta ? 0 : 1 / Long(steps[i - 1].forward);
        dvcm[i] = before * Long(steps[i].d2) / Long(steps[i].cos_in);
    }
    Long sum = 0;
    for (size_t j = 0; j + 1 < steps.size(); ++j) {
        if (steps[j].delta) continue;  // no strategy ends there
        Long term = (j == 0 ? 1 : Long(mis.connections)) * dvcm[j];
        for (size_t i = j; i + 1 < steps.size(); ++i) {
            term *= Long(steps[i].cos_out) / Long(steps[i].forward) / Long(steps[i + 1].cos_in);
            if (i > j) term *= Long(steps[i].reverse);
        }
        sum += power(mis.heuristic, term);
    }
    return {dvcm.back(), root(mis.heuristic, sum)};
}

}  // namespace

TEST_CASE(
    "B28: sums along subpaths equal the sum over all strategies, to 10 roundings a vertex, over 60 powers of ten") {
    Numbers numbers(2);
    for (const MisHeuristic h : kHeuristics)
        for (const float decades : {1.0f, 6.0f, 15.0f, 30.0f}) {
            Worst worst;
            int compared = 0;
            for (int i = 0; i < 100000; ++i) {
                const BidirectionalMis mis{h, kAllStrategies, 1000.0f, i % 2 ? 1.0f : 0.01f};
                const size_t n = 1 + numbers.index(12);
                std::vector<Step> steps(n);
                for (Step& s : steps) {
                    s = {numbers.magnitude(-decades, decades),     std::min(numbers.magnitude(-4, 0), 1.0f),
                         std::min(numbers.magnitude(-4, 0), 1.0f), numbers.magnitude(-decades, decades),
                         numbers.magnitude(-decades, decades),     numbers.chance(0.2f)};
                }
                const MisSums start = {numbers.magnitude(-decades, decades), 0.0f};
                MisSums sums = start;
                // Whatever is computed on the way must be an ordinary float, or 0 where no strategy is behind.
                bool ordinary = true, behind = false;
                const auto check = [&](float x) { ordinary = ordinary && x > 1e-36f && x < 1e37f; };
                for (size_t k = 0; k < n; ++k) {
                    const Step& s = steps[k];
                    const bool after_delta = k > 0 && steps[k - 1].delta;
                    sums = mis.sums_at_hit(sums, s.d2, s.cos_in, false);
                    if (!after_delta) check(sums.dvcm);
                    if (behind) check(sums.dvc);
                    if (k + 1 == n) break;
                    check(s.cos_out / s.forward);
                    check(s.cos_out * s.reverse);
                    check(s.cos_out * s.reverse / s.forward);
                    if (behind) check(sums.dvc * s.reverse);
                    if (!after_delta) check(mis.connection_dvcm(sums, k == 0));
                    sums = mis.sums_after_scatter(sums, k == 0, s.delta, s.forward, s.reverse, s.cos_out);
                    behind = behind || (!s.delta && !after_delta);
                    if (!s.delta) check(sums.dvcm);
                    if (behind) check(sums.dvc);
                }
                if (!ordinary) continue;
                const TrueSums truth = true_sums(mis, start, steps);
                const double bound = 10 * double(n) * kUnit;
                ++compared;
                if (truth.dvcm > 0) worst.add(std::fabs(double((Long(sums.dvcm) - truth.dvcm) / truth.dvcm)), bound);
                if (truth.dvc > 0) worst.add(std::fabs(double((Long(sums.dvc) - truth.dvc) / truth.dvc)), bound);
            }
            std::printf("%s, 1e%g: %d subpaths, %.2f of the bound\n", Heuristics::kNames[int(h)], double(decades),
                        compared, worst.share);
            CHECK(compared > 3000);
            CHECK(worst.share <= 1);
        }
}

TEST_CASE("B28: weights never leave [0,1] nor turn into no number, whatever the sums") {
    Numbers numbers(3);
    const std::vector<float> extremes = {0.0f, 1e-45f, 0x1p-126f, 1e-30f, 1.0f, 1e30f, 0x1.fffffep127f, kInfinity};
    int bad = 0;
    for (const MisHeuristic h : kHeuristics) {
        for (const float a : extremes)
            bad += !(mis_weight(heuristic_term(h, a)) >= 0 && mis_weight(heuristic_term(h, a)) <= 1);
        for (int i = 0; i < 300000; ++i) {
            const BidirectionalMis mis{h, kAllStrategies, 1000.0f, 1.0f};
            const auto any = [&] { return numbers.magnitude(-30, 30); };
            const MisSums y = {any(), any()}, z = {any(), any()};
            const float w = mis_weight(mis.connection_ratio(y, i % 2, z, i % 3 == 0, {any(), any(), any(), any()}));
            bad += !(w >= 0 && w <= 1);
        }
    }
    CHECK(bad == 0);
}
