// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Weights of vertex connection and merging (integrators/bdpt/vcm/merging_mis.h) against the densities of all strategies
// enumerated, merges among them.
#include "integrators/bdpt/vcm/merging_directions.h"
#include "tests/support/bidirectional_paths.h"
#include "transport/mis/by_tree.h"

namespace ambilux {

inline test::OracleMerges merges_of(const MergingMis& mis) {
    return {double(mis.now->eta), mis.merges_first, !mis.beside(), double(mis.largest_footprint),
            double(mis.least_area)};
}

}  // namespace ambilux

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("Weights with merging equal those of all strategies enumerated, and sum to one with those of merges") {
    const MergeNow now[] = {{0.01f, 0x1p-10f}, {0.1f, 1.0f}, {0.5f, 300.0f}};
    const std::map<std::string, uint64_t> seen =
        compare_weights(0.05, [&](uint32_t i) { return MergingMis{settings(i), &now[i / 16 % 3], i / 48 % 2 == 0}; });
    CHECK(seen.at("merges") > 10000);
    for (const char* kind : {"hit", "escape", "next event", "connection", "light tracing", "visible light"})
        CHECK(seen.at(std::string(kind) + ", perspective") >= 20);
}

TEST_CASE("The same where the radius is as large as a pixel at the first vertex of the eye subpath") {
    const MergeNow now[] = {{0.01f, 0x1p-10f}, {0.1f, 1.0f}, {0.5f, 300.0f}};
    const std::map<std::string, uint64_t> seen = compare_weights(0.03, [&](uint32_t i) {
        MergingMis mis{settings(i), &now[i / 16 % 3], i / 48 % 2 == 0};
        mis.largest_footprint = 0.04f;
        mis.least_area = 0.01f;
        return mis;
    });
    CHECK(seen.at("merges") > 5000);
}

TEST_CASE("So they do where next event estimation picks lights by a tree") {
    const MergeNow now[] = {{0.01f, 0x1p-10f}, {0.1f, 1.0f}, {0.5f, 300.0f}};
    const std::map<std::string, uint64_t> seen = compare_weights(
        0.05, [&](uint32_t i) { return ByTree<MergingMis>{{settings(i), &now[i / 16 % 3], i / 48 % 2 == 0}}; });
    CHECK(seen.at("merges") > 10000);
    CHECK(seen.at("next event, perspective") >= 20);
}

TEST_CASE("Where merges are alone, their weights sum to one, and hits count where none is possible") {
    const MergeNow now[] = {{0.01f, 0x1p-10f}, {0.1f, 1.0f}, {0.5f, 300.0f}};
    const std::map<std::string, uint64_t> seen = compare_weights(0.05, [&](uint32_t i) {
        MergingMis mis{settings(i), &now[i / 16 % 3]};
        mis.strategies = kHitStrategies;
        mis.merges = Merges::alone;
        return mis;
    });
    CHECK(seen.at("merges") > 10000);
    CHECK(seen.at("hit, perspective") >= 20);
}

TEST_CASE("A merge with a radius of nothing weighs nothing, and leaves the others their weights") {
    const MergeNow now = {0.0f, 0.0f};
    const BidirectionalMis two = settings(0);
    const MergingMis mis{two, &now, true};
    const MergingSums y{2.0f, 3.0f, 5.0f, 1.0f}, z{7.0f, 0.5f, 4.0f, 1.0f};
    const ConnectionDensities p{0.3f, 0.2f, 0.7f, 1.1f};
    CHECK(mis.connection_ratio(y, false, z, false, p) ==
          two.connection_ratio({y.dvcm, y.dvc}, false, {z.dvcm, z.dvc}, false, p));
    BsdfValue f{};
    f.pdf_sa = f.pdf_reverse_sa = 0.3f;
    CHECK(mis_weight(mis.merge_ratio(y, false, z, false, f)) == 0.0f);
}
