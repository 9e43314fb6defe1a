// libs: ambilux_film
// timeout: 300
// The commands reference, compare, experiment and stress: what is continued.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/atomic_file.h"
#include "film/exr_io.h"
#include "tests/support/program.h"

using namespace ambilux;
using namespace ambilux::test;
namespace fs = std::filesystem;
using nlohmann::json;

TEST_CASE("a reference in double precision is continued in double precision alone") {
    const test::TempFolder folder;
    const auto reference = [&](const std::string& spp, const std::string& precision) {
        return run(folder, {"reference", kCornell, "--size", "12x8", "--spp", spp, "-o", folder / "r.exr",
                            "--precision", precision, "--json", folder / "r.json"});
    };
    CHECK(reference("4", "double").code == 0);
    CHECK(reference("8", "double").code == 0);
    const json j = json::parse(read_file(folder / "r.json"));
    CHECK(j["continued_from"] == 4);
    CHECK(contains(j["device"].get<std::string>(), "double precision"));
    const Outcome other = reference("16", "single");
    CHECK(other.code == 3);
    CHECK(contains(other.err, "precision=double"));
    CHECK(reference("16", "half").code == 2);
}

TEST_CASE("a reference is continued, extended, compared with") {
    const test::TempFolder folder;
    const auto reference = [&](const std::string& spp, const std::string& size = "24x16") {
        return run(folder, {"reference", kCornell, "--size", size, "--spp", spp, "-o", folder / "r.exr", "--json",
                            folder / "r.json"});
    };
    CHECK(reference("16").code == 0);
    CHECK(reference("48").code == 0);
    CHECK(json::parse(read_file(folder / "r.json"))["continued_from"] == 16);
    CHECK(contains(reference("48").err, "nothing to do"));
    const Reference r = read_reference_exr(folder / "r.exr");
    CHECK(r.samples == 48);
    CHECK(r.standard_error.rgb.size() == 24 * 16 * 3);
    // By another integrator too, whose settings are part of its identity.
    const auto by_bdpt = [&](const std::string& variant) {
        return run(folder, {"reference", kCornell, "--size", "24x16", "--spp", "4", "--set", "integrator=bdpt", "--set",
                            "variant=" + variant, "-o", folder / "b.exr"});
    };
    CHECK(by_bdpt("lvc").code == 0);
    Attributes made;
    read_reference_exr(folder / "b.exr", &made);
    CHECK(made["integrator"] == "bdpt");
    CHECK(contains(made["reference_settings"].get<std::string>(), "variant=lvc"));
    CHECK(contains(by_bdpt("wavefront").err, "reference_settings"));
    CHECK(
        run(folder, {"reference", kCornell, "--spp", "4", "--set", "integrator=light", "-o", folder / "l.exr"}).code ==
        2);
    const Outcome other = reference("64", "16x16");
    CHECK(other.code == 3);
    CHECK(contains(other.err, "its size is 24x16, asked for is 16x16"));

    REQUIRE(run(folder, render(folder, {"--spp", "16"})).code == 0);
    const Outcome o = run(folder, {"compare", folder / "a.exr", folder / "r.exr", "--json", "-"});
    REQUIRE(o.code == 0);
    const json j = json::parse(o.out);
    for (const char* name : {"rmse", "rmse_corrected", "reference_noise", "relmse", "mape", "bias_z"})
        CHECK(j[name].is_number());
    CHECK(j["reference_spp"] == 48);
    CHECK(std::abs(j["bias_z"].get<double>()) < 5);
    CHECK(contains(run(folder, {"compare", folder / "a.exr", folder / "r.exr"}).out, "RMSE"));
    REQUIRE(run(folder, {"render", kCornell, "--size", "8x8", "--spp", "1", "-o", folder / "small.exr"}).code == 0);
    const Outcome sizes = run(folder, {"compare", folder / "small.exr", folder / "r.exr"});
    CHECK(sizes.code == 3);
    CHECK(contains(sizes.err, "small.exr"));
    CHECK(contains(sizes.err, "8x8"));
}

TEST_CASE("an experiment, killed and resumed") {
    const test::TempFolder folder;
    std::ofstream(folder / "e.toml")
        << "seeds = [1, 2]\nreference = { spp = 64 }\nbudget = { spp = [1, 4, 16] }\n[[scene]]\nname = "
           "\"cornell\"\npath = \""
        << kCornell
        << "\"\nsize = [24, 16]\nmax_depth = 4\n[[run]]\nname = \"nee\"\nintegrator = \"path\"\nestimator = \"nee\"\n"
        << "[[run]]\nname = \"mis\"\nintegrator = \"path\"\n";
    const pid_t child = start(folder, {"experiment", folder / "e.toml", "-o", folder / "out"});
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    ::kill(child, SIGKILL);
    finish(folder, child);
    const Outcome o = run(folder, {"experiment", folder / "e.toml", "-o", folder / "out", "--resume"});
    INFO(o.err);
    CHECK(o.code == 0);
    const std::string csv = read_file(folder / "out/runs.csv");
    CHECK(std::count(csv.begin(), csv.end(), '\n') == 1 + 2 * 2 * 3);
    CHECK(fs::exists(folder.path / "out/images/cornell/mis_2.png"));
    const Outcome again = run(folder, {"experiment", folder / "e.toml", "-o", folder / "out"});
    CHECK(again.code == 2);
    CHECK(contains(again.err, "--resume"));
    std::ofstream(folder / "bad.toml") << "seeds = [1]\nreferense = { spp = 64 }\n";
    const Outcome bad = run(folder, {"experiment", folder / "bad.toml", "-o", folder / "out2"});
    CHECK(bad.code == 3);
    CHECK(contains(bad.err, "bad.toml:2: unknown key 'referense'"));
}

TEST_CASE("stress: families are listed, scenes exported, cells rendered and gone on with") {
    const test::TempFolder folder;
    const Outcome list = run(folder, {"stress", "--list"});
    CHECK(list.code == 0);
    CHECK(contains(list.out, "far-mesh"));
    const std::string out = folder / "sweep", scenes = folder / "scenes";
    const std::vector<std::string> one = {"stress",   "--quick",   "--family", "mirrored", "--method",
                                          "path-mis", "--backend", "cpu",      "-o",       out};
    const Outcome first = run(folder, one);
    CHECK(first.code == 0);
    CHECK(contains(first.out, "3 ok, 0 left out of 3 rows"));
    CHECK(contains(read_file(out + "/stress.csv"), "mirrored_4,mirrored,4,path-mis,cpu,ok,"));
    const Outcome again = run(folder, one);
    CHECK(again.code == 2);
    CHECK(contains(again.err, "--resume"));
    REQUIRE(run(folder, {"stress", "--export", scenes, "--family", "mirrored", "--quick"}).code == 0);
    const std::string expected = read_file(scenes + "/expected.csv");
    CHECK(std::count(expected.begin(), expected.end(), '\n') == 4);
    CHECK(run(folder, {"render", scenes + "/mirrored_4.xml", "-o", folder / "m.exr", "--spp", "1", "--backend", "cpu"})
              .code == 0);
}
