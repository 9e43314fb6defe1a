// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Weights that know what merges have in common (integrators/bdpt/correlated/correlation_mis.h) against the densities of
// all strategies enumerated, those of merges scaled.
#include "integrators/bdpt/correlated/correlation_mis.h"
#include "integrators/bdpt/vcm/merging_directions.h"
#include "tests/support/bidirectional_paths.h"

namespace ambilux {

inline test::OracleMerges merges_of(const CorrelationMis& mis) {
    return {double(mis.now->eta), mis.merges_first,        false, double(mis.largest_footprint), double(mis.least_area),
            kMostCorrelated,      double(mis.least_factor)};
}

}  // namespace ambilux

using namespace ambilux;
using namespace ambilux::test;

namespace {

CorrelationMis correlated(const BidirectionalMis& two, const MergeNow& now, bool first, float least) {
    CorrelationMis mis{{two, &now, first}};
    mis.least_factor = least;
    return mis;
}

}  // namespace

TEST_CASE("Weights that know what merges have in common equal those of all strategies enumerated, and sum to one") {
    const MergeNow now[] = {{0.01f, 0x1p-10f}, {0.1f, 1.0f}, {0.5f, 300.0f}};
    const float least[] = {0.0f, 1e-6f, 1.0f / 300};
    const std::map<std::string, uint64_t> seen = compare_weights(
        0.05, [&](uint32_t i) { return correlated(settings(i), now[i / 16 % 3], i / 48 % 2 == 0, least[i / 96 % 3]); });
    CHECK(seen.at("merges") > 10000);
    for (const char* kind : {"hit", "escape", "next event", "connection", "light tracing", "visible light"})
        CHECK(seen.at(std::string(kind) + ", perspective") >= 20);
}

TEST_CASE("Factors of merges: one at the first vertex, what both chances say at others, and never below the least") {
    CorrelatedPath p;
    p.size = 3;
    p.nearby = 0.5f;
    p.emitter = kInfinity;
    const float eye[] = {0.4f, 8.0f, 0.1f}, light[] = {1.0f, 0.2f, 0.6f};
    std::copy(std::begin(eye), std::end(eye), p.eye);
    std::copy(std::begin(light), std::end(light), p.light);
    float factor[kMostCorrelated];
    p.factors(0.0f, factor);
    const auto of = [](double c, double l) { return c / (c + l - c * l); };
    CHECK(factor[0] == 1.0f);
    CHECK(factor[1] == Approx(of(0.2, 0.1 * 0.3)));
    CHECK(factor[2] == Approx(of(0.2 * 0.05, 0.3)));
    p.factors(0.25f, factor);
    CHECK(factor[2] == 0.25f);
    // What a delta leads to follows: seen through a pane, the vertex behind it is as near as the pane.
    p.deltas = 1u << 1;
    p.factors(0.0f, factor);
    CHECK(factor[2] == Approx(of(0.2, 0.3)));
    p.emitter = 0.2f;
    p.factors(0.0f, factor);
    CHECK(factor[2] == Approx(of(0.2, 0.1 * 0.3)));
    // Products that no float holds.
    for (uint32_t i = 0; i < 3; ++i) p.eye[i] = p.light[i] = 1e-20f;
    p.deltas = 0;
    p.factors(0.0f, factor);
    CHECK(factor[2] == Approx(2e-9).epsilon(1e-3));
}

TEST_CASE("Where another eye subpath comes by as surely as not, weights are those of plain vcm") {
    const MergeNow now = {0.1f, 3.0f};
    const MergingMis plain{settings(0), &now, true};
    const CorrelationMis mis = correlated(settings(0), now, true, 1.0f);  // no factor below one
    const float reverse = 0.7f, forward = 0.9f, cosine = 0.6f, d2 = 4.0f;
    const auto go_on = [&](MergingSums m) {
        CorrelationSums s{};
        s.merging = m;
        s.start = 0.01f;
        s.add(0.3f);
        return mis.sums_after_scatter(s, true, false, forward, reverse, cosine);
    };
    const auto arrive = [&](CorrelationSums s) {
        s.merging = {s.merging.dvcm * d2 / cosine, s.merging.dvc / cosine, s.merging.dvm / cosine, 1.0f};
        s.add(s.pending[0] * cosine / d2);
        s.pending[0] = s.pending[1] / d2;
        return s;
    };
    const CorrelationSums y = arrive(go_on({2.0f, 0.4f, 1.0f, 1.0f})), z = arrive(go_on({0.5f, 0.0f, 1.0f, 1.0f}));
    BsdfValue f{};
    f.pdf_sa = 0.3f;
    f.pdf_reverse_sa = 0.2f;
    CHECK(mis.merge_ratio(y, false, z, false, f) ==
          Approx(double(plain.merge_ratio(y.merging, false, z.merging, false, f))));
    const ConnectionDensities d{0.3f, 0.2f, 0.7f, 1.1f};
    CHECK(mis.connection_ratio(y, false, z, false, d) ==
          Approx(double(plain.connection_ratio(y.merging, false, z.merging, false, d))));
}
