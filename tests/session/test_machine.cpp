// libs: ambilux_experiments
// timeout: 60
// What an experiment records of its machine: load, versions, clocks.
#include "backends/cuda_device.h"
#include "session/load.h"
#include "session/machine.h"
#include "tests/support/experiment_fakes.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("what others take of the machine is told from what this process takes") {
    LoadReading reading;
    parse_cpu_line("cpu  100 20 30 4000 50 6 7 80 9 0", 100, reading);
    CHECK(reading.busy == Approx(1.63));
    CHECK(reading.steal == Approx(0.8));
    LoadReading before, after;
    after.wall = 2;
    after.busy = 5;
    after.own = 3;
    after.steal = 1;
    CHECK(other_cores(before, after) == Approx(1.5));
    after.own = 9;  // clocks of different grain
    CHECK(other_cores(before, after) == 0.0);
    CHECK(load_json(before, after)["own_cores"] == 4.5);
    const LoadReading now = read_load();
    CHECK(now.wall > 0);
    CHECK(now.own > 0);
    CHECK(now.busy >= 0);
    CHECK(contains(command_line(), "test_machine"));
    const nlohmann::json versions = describe_versions();
    for (const char* key : {"ambilux", "git_revision", "compiler", "flags", "embree", "tbb"})
        CHECK_FALSE(versions[key].get<std::string>().empty());
}

TEST_CASE("clocks of graphics cards are read from what nvidia-smi prints") {
    const auto gpus = parse_gpu_clocks("1980, 2619, 41\n345, [N/A], 30\n");
    REQUIRE(gpus.size() == 2);
    CHECK(gpus[0]["sm_mhz"] == 1980);
    CHECK(gpus[0]["memory_mhz"] == 2619);
    CHECK(gpus[0]["celsius"] == 41);
    CHECK(gpus[1]["memory_mhz"].is_null());
    CHECK(parse_gpu_clocks("").empty());
    CHECK(describe_clocks("start", false)["gpu"].is_null());
    const auto clocks = describe_clocks("start", true);
    CHECK(clocks["when"] == "start");
    CHECK(clocks["date"].is_string());
    // Of the device that renders alone, whatever else the machine has.
    if (cuda_device_bus_id().empty())
        CHECK(clocks["gpu"].is_null());
    else if (!clocks["gpu"].is_null())
        CHECK(clocks["gpu"].size() == 1);
}
