// libs: ambilux_film
// timeout: 120
// The command bench.
#include <map>

#include "core/atomic_file.h"
#include "tests/support/program.h"

using namespace ambilux;
using namespace ambilux::test;
using nlohmann::json;

TEST_CASE("bench stages prints times an item, and writes them") {
    const test::TempFolder folder;
    const Outcome bench =
        run(folder, {"bench", "stages", kCornell, "--size", "24x16", "--spp", "2", "--json", folder / "b.json"});
    CHECK(bench.code == 0);
    CHECK(contains(bench.out, "ns/item"));
    CHECK(json::parse(read_file(folder / "b.json"))["spp"] == 2);
}

TEST_CASE("bench stages apportions the time of stages that run others inside of them") {
    const test::TempFolder folder;
    const std::vector<std::string> command = {"bench", "stages", kCornell, "--backend", "cpu", "--size",
                                              "24x16", "--spp",  "8",      "-i",        "bdpt"};
    const auto with = [&](std::initializer_list<std::string> more) {
        std::vector<std::string> all = command;
        all.insert(all.end(), more);
        return run(folder, all);
    };
    const Outcome bench = with({"--unfused", "--json", folder / "b.json"});
    REQUIRE(bench.code == 0);
    CHECK(contains(bench.out, "shares of a render with fuse=none"));
    const json j = json::parse(read_file(folder / "b.json")), shares = j["fused_shares"];
    CHECK(contains(shares["how"].get<std::string>(), "an estimate"));
    CHECK(shares["unfused_seconds"].get<double>() > 0);
    std::map<std::string, double> sums;
    for (const json& s : shares["stages"]) sums[s["inside"]] += s["seconds"].get<double>();
    CHECK(sums.count("shade") == 1);
    for (const json& s : j["stages"])
        if (sums.count(s["name"])) CHECK(sums[s["name"]] == Approx(s["seconds"].get<double>()).epsilon(1e-6));
    const Outcome refused = with({"--unfused", "--set", "fuse=none"});
    CHECK(refused.code == 2);
    CHECK(contains(refused.err, "no stage runs inside of another"));
}

TEST_CASE("bench frames: times of images, and the memory that they took") {
    const test::TempFolder folder;
    const Outcome bench =
        run(folder, {"bench", "frames", kCornell, "--backend", "cpu", "--size", "24x16", "-i", "bdpt", "--variant",
                     "lvc", "--memory", "64M", "--frames", "5", "--json", folder / "f.json"});
    REQUIRE(bench.code == 0);
    CHECK(contains(bench.out, "frames_per_second"));
    const json told = json::parse(read_file(folder / "f.json"));
    CHECK(told["frames"] == 5);
    CHECK(told["memory"] == "64M");
    CHECK(told["median_seconds"] > 0.0);
    CHECK(told["percentile_95_seconds"] >= told["median_seconds"]);
    CHECK(told["memory_bytes_peak"] <= 64u << 20);
    CHECK(told["memory_bytes_peak"] >= told["memory_bytes_predicted"]);
}

TEST_CASE("bench queues") {
    const test::TempFolder folder;
    const std::vector<std::string> command = {"bench",   "queues", kCornell,        "--backend", "cpu",
                                              "--items", "1024",   "--repetitions", "1",         "--json"};
    const auto with = [&](const std::string& output) {
        std::vector<std::string> all = command;
        all.push_back(output);
        return run(folder, all);
    };
    const Outcome table = with(folder / "q.json"), plain = with("-");
    REQUIRE(table.code == 0);
    REQUIRE(plain.code == 0);
    for (const char* text : {"backend: cpu", "ns_per_item", "ConnectionVertex", "select", "morton"})
        CHECK(contains(table.out, text));
    const json file = json::parse(read_file(folder / "q.json")), printed = json::parse(plain.out);
    CHECK(file["items"] == 1024);
    CHECK(file["rows"].size() == printed["rows"].size());
    // On a machine without a device; with one it has nothing to say.
    const Outcome device =
        run(folder, {"bench", "queues", kCornell, "--backend", "cuda", "--items", "1024", "--repetitions", "1"});
    CHECK((device.code == 0 || device.code == 4));
    if (device.code == 4)
        CHECK((contains(device.err, "--backend cuda: no CUDA device answers: ") ||
               contains(device.err, "--backend cuda: this program was built without CUDA")));
}
