// libs: ambilux_experiments
// timeout: 300
// The built program, killed with SIGKILL at random moments and resumed, leaves what an uninterrupted run leaves.
#include <signal.h>

#include <chrono>
#include <random>
#include <thread>

#include "film/exr_io.h"
#include "tests/support/program.h"
#include "tests/support/result_rows.h"

using namespace ambilux;
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

std::string config() {
    const std::string scenes = std::string(AMBILUX_SOURCE_DIR) + "/scenes/";
    return R"(seeds = [1, 2]
repeats = 0
backend = "cpu"
[reference]
spp = 512
[budget]
spp = [1, 3, 9, 40]
[[scene]]
name = "cornell"
path = ")" +
           scenes + R"(cornell.xml"
size = [24, 16]
max_depth = 4
[[scene]]
name = "glass"
path = ")" +
           scenes + R"(glass.xml"
size = [16, 12]
max_depth = 6
reference = { integrator = "bdpt", variant = "wavefront", spp = 100 }
[[run]]
name = "path"
integrator = "path"
sweep = { estimator = ["nee", "mis"], rr_depth = [2, 5] }
[[run]]
name = "lvc"
integrator = "bdpt"
variant = "lvc"
sweep = { connections = [1, 4] }
[[run]]
name = "pyramid"
integrator = "bdpt"
variant = "wavefront"
techniques = 3
)";
}

/// Files below `folder` that a finished experiment is made of, by their relative names.
std::vector<std::string> files_of(const fs::path& folder) {
    std::vector<std::string> names;
    for (const auto& file : fs::recursive_directory_iterator(folder))
        if (file.is_regular_file()) names.push_back(file.path().lexically_relative(folder).string());
    std::sort(names.begin(), names.end());
    return names;
}

}  // namespace

TEST_CASE("kill -9 at random moments, resumed each time: the same rows, images and counts") {
    const test::TempFolder folder;
    const std::string file = folder.write("e.toml", config()), whole = (folder.path / "whole").string(),
                      killed = (folder.path / "killed").string();
    const auto begin = [&](const std::vector<std::string>& arguments) {
        return test::start(folder, arguments, "/dev/null");
    };
    const auto begun = std::chrono::steady_clock::now();
    REQUIRE(test::finish(folder, begin({"experiment", file, "-o", whole})).code == 0);
    const double duration = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    const auto expected = test::timeless(whole + "/runs.csv");
    REQUIRE(expected.size() == 2 * 2 * 7 * 4);

    const unsigned seed = std::random_device()();
    CAPTURE(seed);
    std::mt19937 random(seed);
    int kills = 0;
    size_t rows = 0;
    double longest = 0.5 * duration;
    for (int attempt = 0; attempt < 8; ++attempt) {
        const pid_t child = begin({"experiment", file, "-o", killed, "--resume"});
        std::this_thread::sleep_for(
            std::chrono::duration<double>(std::uniform_real_distribution<double>(0.04, 1.0)(random) * longest));
        ::kill(child, SIGKILL);
        const auto [code, out, err] = test::finish(folder, child);
        INFO(err);
        REQUIRE((code == -SIGKILL || code == 0));
        kills += code != 0;
        if (kills == 0) {  // done before the signal: the first run was timed on a busier machine. Once more, sooner.
            longest *= 0.5;
            fs::remove_all(killed);
            continue;
        }
        const size_t now = fs::exists(killed + "/runs.csv") ? read_results(killed + "/runs.csv").size() : 0;
        // A render that keeps images of single strategies shows its rows when it is complete, so that none are ever
        // lost.
        CHECK(now >= rows);
        rows = now;
    }
    CHECK(kills >= 1);
    const test::Outcome last = test::finish(folder, begin({"experiment", file, "-o", killed, "--resume"}));
    INFO(last.err);
    REQUIRE(last.code == 0);

    CHECK(bool(test::timeless(killed + "/runs.csv") == expected));
    const auto files = files_of(whole);
    CHECK(files_of(killed) == files);
    size_t images = 0, statistics = 0, techniques = 0;
    for (const std::string& name : files) {
        CAPTURE(name);
        if (name.ends_with(".exr")) {
            CHECK(bool(read_exr(whole + "/" + name).rgb == read_exr(killed + "/" + name).rgb));
            ++images;
            techniques += name.starts_with("techniques/");
        } else if (name.starts_with("stats/")) {
            // What the parts of a resumed render did adds up.
            const json a = json::parse(read_file(whole + "/" + name)), b = json::parse(read_file(killed + "/" + name));
            CHECK(a["rays"] == b["rays"]);
            CHECK(a["spp"] == b["spp"]);
            REQUIRE(a["stages"].size() == b["stages"].size());
            for (size_t i = 0; i < a["stages"].size(); ++i) {
                CHECK(a["stages"][i]["name"] == b["stages"][i]["name"]);
                // The clock sizes batches, and a stage that runs over all slots of a batch counts those that stay empty
                // too.
                const std::string stage = a["stages"][i]["name"];
                if (stage == "extend" || stage == "shade" || stage == "occlude")
                    CHECK(a["stages"][i]["items"] == b["stages"][i]["items"]);
            }
            ++statistics;
        }
    }
    CHECK(statistics == 2 * 2 * 7);
    CHECK(techniques == 2 * 2 * 2 * (2 + 3 + 4));
    CHECK(images == statistics + techniques + 2);
    const json manifest = json::parse(read_file(killed + "/manifest.json"));
    CHECK(manifest["resumed"].size() >= 1);
    CHECK(manifest["clocks"].back()["when"] == "end");
}
