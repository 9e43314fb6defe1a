// A heuristic of multiple importance sampling is a struct and an entry of the list (docs/extending.md).
#include "tests/support/catch.h"
#include "transport/mis/heuristic.h"

using namespace ambilux;

namespace {

/// The power heuristic with beta = 3.
struct CubeHeuristic {
    static constexpr const char* kName = "cube";
    AMBILUX_HD static float term(float ratio) { return ratio * ratio * ratio; }
    AMBILUX_HD static float norm(float a, float b) { return cbrtf(term(a) + term(b)); }
};
using WithCube = HeuristicList<BalanceHeuristic, PowerHeuristic, CubeHeuristic>;

struct WithoutNorm {
    static constexpr const char* kName = "no norm";
    static float term(float ratio) { return ratio; }
};

}  // namespace

TEST_CASE("What lacks a function is no heuristic") {
    STATIC_REQUIRE((Heuristic<CubeHeuristic> && Heuristic<PowerHeuristic>));
    STATIC_REQUIRE_FALSE(Heuristic<WithoutNorm>);
}

TEST_CASE("a heuristic of one's own: weights of all strategies sum to one, and norms are sums of terms") {
    const float densities[] = {0.3f, 2.0f, 0.0f, 1.1f, 7.0f};
    for (uint32_t which = 0; which < 3; ++which) {
        INFO(WithCube::kNames[which]);
        float sum = 0.0f;
        for (const float own : densities) {
            if (own == 0.0f) continue;
            float others = -WithCube::term(which, 1.0f);
            for (const float p : densities) others += WithCube::term(which, p / own);
            sum += mis_weight(others);
        }
        CHECK(sum == Approx(1.0f));
        CHECK(WithCube::term(which, 0.7f * 1.9f) == Approx(WithCube::term(which, 0.7f) * WithCube::term(which, 1.9f)));
        CHECK(WithCube::term(which, WithCube::norm(which, 0.7f, 1.9f)) ==
              Approx(WithCube::term(which, 0.7f) + WithCube::term(which, 1.9f)));
    }
    CHECK(WithCube::kNames[2] == std::string("cube"));
    CHECK(WithCube::term(2, 2.0f) == 8.0f);
}
