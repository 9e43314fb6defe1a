// libs: ambilux_experiments
// timeout: 60
// What an experiment records of its machine: load, versions, clocks.
#include <sys/sysinfo.h>
#include <sys/utsname.h>
#include <sys/wait.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <ctime>
#include <sstream>

#include "backends/cuda_device.h"
#include "core/version.h"
#include "session/load.h"
#include "session/machine.h"
#include "tests/support/experiment_fakes.h"
#include "tests/support/skip.h"

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
    before = {10, 20, 30, 40, 50, 0.25, 0};
    after = {12, 26, 31, 42.5, 50.5, 1.5, 2100};
    nlohmann::json told = load_json(before, after);
    CHECK(told["cores"] == std::thread::hardware_concurrency());
    told.erase("cores");
    CHECK(told == nlohmann::json::parse(R"({"seconds": 2.0, "other_cores": 1.5, "own_cores": 0.5, "rank_cores": 1.25,
        "steal_cores": 0.25, "load": {"before": 0.25, "after": 1.5}, "cpu_mhz": {"before": null, "after": 2100.0}})"));
    CHECK(other_cores(after, before) == 0.0);
    const LoadReading now = read_load();
    CHECK(now.wall > 0);
    CHECK(now.own > 0);
    CHECK(now.busy >= 0);
    CHECK(contains(command_line(), "test_machine"));
    const nlohmann::json versions = describe_versions();
    CHECK(versions.size() == 7);
    for (const char* key : {"ambilux", "git_revision", "compiler", "flags", "embree", "tbb"})
        CHECK_FALSE(versions[key].get<std::string>().empty());
    CHECK(versions["ambilux"] == version());
    CHECK(versions["git_revision"] == git_revision());
    CHECK(versions["compiler"] == compiler());
}

TEST_CASE("the command line is told as a shell takes it: only what it would read otherwise is in quotes") {
    std::ifstream in("/proc/self/cmdline", std::ios::binary);
    std::string expected;
    for (std::string argument; std::getline(in, argument, '\0');) {
        const auto plain = [](char c) {
            return std::isalnum(static_cast<unsigned char>(c)) || strchr("/._-+=,:~[]", c);
        };
        const bool quoted = argument.empty() || !std::all_of(argument.begin(), argument.end(), plain);
        expected += (expected.empty() ? "" : " ") + (quoted ? "'" + argument + "'" : argument);
    }
    CHECK(command_line() == expected);
}

TEST_CASE("CPU seconds of a process are its own and those of its ended children, whatever its name is") {
    const std::string numbers = " S 1 2 3 4 5 6 7 8 9 10 100 20 3000 400 20 0 1 0 5000";
    CHECK(parse_stat_seconds("17 a" + numbers, 100) == 0);
    CHECK(parse_stat_seconds("17 (a) b) c)" + numbers, 100) == Approx(35.2));
    CHECK(parse_stat_seconds("17 (a) S 1 2", 100) == 0);
    CHECK(parse_stat_seconds("", 100) == 0);
    LoadReading reading;
    reading.busy = 5;
    parse_cpu_line("cpu0 100 20 30 4000 50 6 7 80 9 0", 100, reading);  // of one core
    CHECK(reading.busy == 5);
}

TEST_CASE("a process that this one has started counts as its own while it runs") {
    if (!fs::exists("/proc/thread-self/children")) return skip("this kernel does not tell a process's children");
    int ready[2], end[2];
    REQUIRE(::pipe(ready) == 0);
    REQUIRE(::pipe(end) == 0);
    const LoadReading before = read_load();
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    char byte = 0;
    if (child == 0) {
        while (std::clock() < CLOCKS_PER_SEC / 10) {}
        ::close(end[1]);
        if (::write(ready[1], &byte, 1) == 1 && ::read(end[0], &byte, 1) != 0) ::_exit(1);
        ::_exit(0);
    }
    ::close(end[0]);
    CHECK(::read(ready[0], &byte, 1) == 1);
    const LoadReading after = read_load();
    CHECK(after.own - before.own >= 0.07);
    ::close(end[1]);
    int status = 0;
    CHECK(::waitpid(child, &status, 0) == child);
    CHECK(status == 0);
}

TEST_CASE("clocks of cores are read from what the kernel prints, and a core that says none is left out") {
    std::istringstream cpuinfo(
        "processor\t: 0\nmodel name\t: A 9.99 MHz\ncpu MHz\t\t: 2100.500\ncache size\t: 1 KB\n\n"
        "processor\t: 1\ncpu MHz\t\t: 1000\n\ncpu MHz\t\t: unknown\ncpu MHz\n"
        "processor\t: 2\ncpu MHz\t\t: 3000.25\n");
    const CpuMhz found = parse_cpu_mhz(cpuinfo);
    CHECK(found.lowest == 1000);
    CHECK(found.highest == 3000.25);
    CHECK(found.mean == Approx((2100.5 + 1000 + 3000.25) / 3));
    std::istringstream nothing("processor\t: 0\n");
    const CpuMhz none = parse_cpu_mhz(nothing);
    CHECK((none.lowest == 0 && none.mean == 0 && none.highest == 0));
}

TEST_CASE("the version of a driver is the first word of digits and dots") {
    CHECK(parse_driver_version(
              "NVRM version: NVIDIA UNIX Open Kernel Module for x86_64  580.65.06  Release Build 1.2") == "580.65.06");
    CHECK(parse_driver_version("NVRM version: 580 v1.2") == "NVRM version: 580 v1.2");
    CHECK(parse_driver_version("").empty());
}

TEST_CASE("a machine is described by its processor, cores, memory and system, and a driver if there is one") {
    const nlohmann::json machine = describe_machine();
    CHECK(machine.size() == 5);
    CHECK(machine["cores"] == std::thread::hardware_concurrency());
    struct sysinfo memory{};
    REQUIRE(::sysinfo(&memory) == 0);
    CHECK(machine["memory_bytes"].get<double>() == Approx(double(memory.totalram) * memory.mem_unit).epsilon(0.01));
    utsname system;
    REQUIRE(::uname(&system) == 0);
    CHECK(machine["system"] == std::string(system.sysname) + ' ' + system.release + ' ' + system.machine);
    const auto value_of = [](const std::string& line) { return line.substr(line.find_first_not_of(" \t:", 10)); };
    nlohmann::json model;  // of the first core; processors of some kinds have no name
    std::ifstream in("/proc/cpuinfo");
    for (std::string line; model.is_null() && std::getline(in, line);)
        if (line.starts_with("model name")) model = value_of(line);
    CHECK(machine["cpu"] == model);
    CHECK(machine["driver"].is_null() == !fs::exists("/proc/driver/nvidia/version"));
}

TEST_CASE("what a command prints is read to its end, and that of one that fails is nothing") {
    CHECK(printed_by("echo 1980, 2619; echo 41") == "1980, 2619\n41\n");
    CHECK(printed_by("seq 1000").size() == 9 * 2 + 90 * 3 + 900 * 4 + 5);
    CHECK(printed_by("echo 7; false").empty());
    CHECK(printed_by("no-such-command 2>/dev/null").empty());
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
    const std::time_t before = std::time(nullptr);
    const auto clocks = describe_clocks("start", true);
    CHECK(clocks.size() == 4);
    CHECK(clocks["when"] == "start");
    std::tm date{};
    const std::string text = clocks["date"];
    const char* const end = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%SZ", &date);
    REQUIRE(end == text.c_str() + text.size());
    CHECK(::timegm(&date) >= before);
    CHECK(::timegm(&date) <= std::time(nullptr));
    if (const auto& mhz = clocks["cpu_mhz"]; !mhz.is_null()) {
        CHECK(mhz["lowest"] > 0);
        CHECK(mhz["lowest"] <= mhz["mean"]);
        CHECK(mhz["mean"] <= mhz["highest"]);
    }
    // Of the device that renders alone, whatever else the machine has.
    if (cuda_device_bus_id().empty())
        CHECK(clocks["gpu"].is_null());
    else if (!clocks["gpu"].is_null())
        CHECK(clocks["gpu"].size() == 1);
}
