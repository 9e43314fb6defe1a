// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// From the records of stages to the statistics of a render.
#include "render/statistics.h"

#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("Values dropped by a stage that runs as part of another count, though it has no launch and no item") {
    std::vector<StageRecord> records(2);
    records[0].launches = 1;
    records[0].items = 7;
    records[1].inf = 2;
    records[1].underflow = 3;
    RenderStats stats;
    fill_stage_stats({"shade", "connect"}, records, stats);
    CHECK(stats.stages.size() == 1);
    CHECK(stats.invalid.inf == 2);
    CHECK(stats.invalid.underflow == 3);
    CHECK(stats.invalid.total() == 2);  // what is below the range of floats is no error by itself
    CHECK(stats.invalid_by_stage.size() == 1);
    CHECK(stats.invalid_by_stage["connect"].underflow == 3);
}
