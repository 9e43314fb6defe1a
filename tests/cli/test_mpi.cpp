// libs: ambilux_experiments
// timeout: 180
// long: tagged
// seconds: 41
// The built program under mpirun: images do not depend on the number of ranks, and a rank that is killed costs nothing
// that was saved.
#include <sched.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <thread>

#include "core/ranks.h"
#include "experiments/disturbed.h"
#include "film/exr_io.h"
#include "tests/support/program.h"
#include "tests/support/result_rows.h"
#include "tests/support/skip.h"

using namespace ambilux;
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

bool can_run() {
    bool there = false;
#if defined(AMBILUX_HAS_MPI)
    there = std::system("mpirun --version > /dev/null 2>&1") == 0;
#endif
    if (!there) skip("mpirun or MPI is not there: several ranks are not tested");
    return there;
}

/// More ranks than cores, as whoever runs the tests, containers included.
pid_t start_ranks(const test::TempFolder& folder, int ranks, const std::vector<std::string>& arguments) {
    for (const char* variable : {"OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"})
        ::setenv(variable, "1", 1);
    std::vector<std::string> all = {"--oversubscribe",     "--bind-to",    "none", "-n",
                                    std::to_string(ranks), AMBILUX_PROGRAM};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return test::start_program(folder, "mpirun", all);
}

test::Outcome run_ranks(const test::TempFolder& folder, int ranks, const std::vector<std::string>& arguments) {
    return test::finish(folder, start_ranks(folder, ranks, arguments));
}

/// Processes that `parent` started, in the order of their ranks; empty until all are there.
std::vector<pid_t> ranks_of(pid_t parent, size_t count) {
    std::vector<pid_t> found;
    for (const auto& entry : fs::directory_iterator("/proc")) {
        std::ifstream file(entry.path() / "stat");
        std::string pid, name, state;
        pid_t of = 0;
        if (!(file >> pid >> name >> state >> of) || of != parent || name != "(ambilux)") continue;
        found.push_back(pid_t(std::stol(pid)));
    }
    std::sort(found.begin(), found.end());
    if (found.size() < count) found.clear();
    return found;
}

template <class Condition>
bool wait_until(Condition condition) {
    for (int i = 0; i < 3000; ++i, std::this_thread::sleep_for(std::chrono::milliseconds(10)))
        if (condition()) return true;
    return false;
}

Image image(const std::string& path) { return read_exr(path); }

}  // namespace

TEST_CASE("1, 2 and 4 ranks make the image of one process") {
    if (!can_run()) return;
    const test::TempFolder folder;
    const std::vector<std::string> how = {"--spp", "40", "-i", "bdpt", "--range-size", "3", "--backend", "cpu"};
    const auto arguments = [&](const std::string& output) {
        std::vector<std::string> all = test::render(folder, how, output);
        all.insert(all.begin(), "--quiet");
        all.insert(all.end(), {"--json", folder / (output + ".json")});
        return all;
    };
    REQUIRE(test::run(folder, arguments("one.exr")).code == 0);
    for (const int ranks : {1, 2, 4}) {
        CAPTURE(ranks);
        const test::Outcome done = run_ranks(folder, ranks, arguments("many.exr"));
        INFO(done.err);
        REQUIRE(done.code == 0);
        CHECK(bool(image(folder / "many.exr").rgb == image(folder / "one.exr").rgb));
        const json stats = json::parse(read_file(folder / "many.exr.json"));
        CHECK(stats["workers"].size() == size_t(ranks));
        uint64_t samples = 0;
        for (const auto& w : stats["workers"]) {
            CHECK(!w["host"].get<std::string>().empty());
            samples += w["samples"].get<uint64_t>();
        }
        CHECK(samples == 40);
        CHECK(stats["rays"] == json::parse(read_file(folder / "one.exr.json"))["rays"]);
    }
    // Ranks of two devices each hand over one film for both.
    std::vector<std::string> shared = arguments("shared.exr");
    shared.insert(shared.end(), {"--devices", "cpu,cpu,cpu,cpu"});
    shared.erase(std::find(shared.begin(), shared.end(), "--backend"),
                 std::find(shared.begin(), shared.end(), "cpu") + 1);
    const test::Outcome done = run_ranks(folder, 2, shared);
    INFO(done.err);
    REQUIRE(done.code == 0);
    CHECK(bool(image(folder / "shared.exr").rgb == image(folder / "one.exr").rgb));
    const json workers = json::parse(read_file(folder / "shared.exr.json"))["workers"];
    std::vector<int> ranks_of_workers;
    for (const auto& w : workers) ranks_of_workers.push_back(w["rank"]);
    CHECK(ranks_of_workers == std::vector{0, 0, 1, 1});
}

TEST_CASE("kill -9 of any rank ends the job with a message; --resume with another number of ranks goes on") {
    if (!can_run()) return;
    const test::TempFolder folder;
    const auto arguments = [&](const std::string& output, std::vector<std::string> more) {
        more.insert(more.end(),
                    {"--spp", "240", "-i", "bdpt", "--range-size", "4", "--backend", "cpu", "--size", "64x48"});
        std::vector<std::string> all = {"render", test::kCornell, "-o", folder / output};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    };
    REQUIRE(test::run(folder, arguments("whole.exr", {})).code == 0);
    struct Kill {
        int ranks;
        size_t victim;
        std::string block_films;
    };
    // The first rank, and one between that adds up films of others for it.
    for (const Kill& kill : {Kill{3, 0, "1"}, {4, 2, "2"}}) {
        CAPTURE(kill.victim);
        const std::string output = "killed" + std::to_string(kill.victim) + ".exr",
                          state = folder / (output + ".state");
        const pid_t job = start_ranks(folder, kill.ranks,
                                      arguments(output, {"--checkpoint", "0.05", "--block-films", kill.block_films}));
        std::vector<pid_t> ranks;
        const bool begun = wait_until([&] {
            if (ranks.empty()) ranks = ranks_of(job, size_t(kill.ranks));
            return fs::exists(state) && !ranks.empty();
        });
        REQUIRE(begun);
        ::kill(ranks[kill.victim], SIGKILL);
        const test::Outcome killed = test::finish(folder, job);
        INFO(killed.err);
        CHECK(killed.code != 0);
        CHECK(test::contains(killed.err, "signal 9"));
        REQUIRE(fs::exists(state));
        if (kill.victim == 0) {
            const test::Outcome refused = run_ranks(folder, 2, arguments(output, {}));
            CHECK(test::contains(refused.err, "--resume"));
        }
        const test::Outcome resumed = run_ranks(folder, 2, arguments(output, {"--resume"}));
        INFO(resumed.err);
        REQUIRE(resumed.code == 0);
        CHECK(test::contains(resumed.err, "were rendered earlier"));
        CHECK(bool(image(folder / output).rgb == image(folder / "whole.exr").rgb));
        CHECK(!fs::exists(state));
    }
}

namespace {

std::string experiment(const std::string& budget) {
    return R"(backend = "cpu"
seeds = [1, 2]
[reference]
spp = 64
[budget]
)" + budget +
           R"(
[[scene]]
name = "cornell"
path = ")" +
           test::kScenes + R"(cornell.xml"
size = [32, 24]
[[scene]]
name = "glass"
path = ")" +
           test::kScenes + R"(glass.xml"
size = [24, 16]
[[run]]
name = "path"
integrator = "path"
sweep = { estimator = ["nee", "mis"] }
[[run]]
name = "bdpt"
integrator = "bdpt"
)";
}

std::vector<std::vector<std::string>> sorted_rows(const std::string& folder) {
    auto rows = test::timeless(folder + "/runs.csv");
    std::sort(rows.begin(), rows.end());
    return rows;
}

}  // namespace

TEST_CASE("an experiment over ranks that are killed has the rows of one process, with device and host", "[long]") {
    if (!can_run()) return;
    const test::TempFolder folder;
    const std::string file = folder.write("e.toml", experiment("spp = [4, 400]"));
    const std::string whole = folder / "whole", killed = folder / "killed";
    REQUIRE(test::run(folder, {"experiment", file, "-o", whole}).code == 0);
    const auto expected = sorted_rows(whole);
    REQUIRE(expected.size() == 2 * 2 * 3 * 2);
    for (const auto& row : expected) CHECK(row[test::column("host")] == host_name());

    size_t rows = 0;
    for (const size_t victim : {1, 0}) {
        const pid_t job = start_ranks(folder, 3, {"experiment", file, "-o", killed, "--resume"});
        std::vector<pid_t> ranks;
        const bool begun = wait_until([&] {
            if (ranks.empty()) ranks = ranks_of(job, 3);
            return !ranks.empty() && fs::exists(killed + "/runs.csv") &&
                   read_results(killed + "/runs.csv").size() > rows;
        });
        REQUIRE(begun);
        ::kill(ranks[victim], SIGKILL);
        CHECK(test::finish(folder, job).code != 0);
        const size_t now = read_results(killed + "/runs.csv").size();
        CHECK(now > rows);
        rows = now;
    }
    REQUIRE(rows < expected.size());
    const test::Outcome resumed = run_ranks(folder, 2, {"experiment", file, "-o", killed, "--resume"});
    INFO(resumed.err);
    REQUIRE(resumed.code == 0);
    CHECK(bool(sorted_rows(killed) == expected));
    const json manifest = json::parse(read_file(killed + "/manifest.json"));
    CHECK(manifest["ranks"].size() == 2);
    CHECK(!manifest["finished"].is_null());
    for (const char* scene : {"cornell", "glass"})
        for (const char* image : {"bdpt_1.exr", "bdpt_2.exr"}) {
            const std::string name = std::string("/images/") + scene + "/" + image;
            CHECK(bool(read_exr(killed + name).rgb == read_exr(whole + name).rgb));
        }
}

namespace {

/// One rank on each of the first two cores of this process; empty if it has but one.
std::vector<std::string> two_bound_ranks(const std::vector<std::string>& arguments) {
    cpu_set_t cores;
    std::vector<std::string> all = {"--oversubscribe", "--bind-to", "none"};
    int found = 0;
    if (::sched_getaffinity(0, sizeof cores, &cores) != 0) return {};
    for (int core = 0; core < CPU_SETSIZE && found < 2; ++core) {
        if (!CPU_ISSET(core, &cores)) continue;
        if (++found == 2) all.push_back(":");
        all.insert(all.end(), {"-n", "1", "taskset", "-c", std::to_string(core), AMBILUX_PROGRAM});
        all.insert(all.end(), arguments.begin(), arguments.end());
    }
    return found == 2 ? all : std::vector<std::string>{};
}

/// As if other processes had held all cores, for the first time.
void disturb(const std::string& path) {
    json stats = json::parse(read_file(path));
    stats.erase("attempts");
    stats["seconds"]["render"] = 100;
    stats["machine"] = {{{"seconds", 100}, {"cores", 1}, {"other_cores", 1}}};
    std::ofstream(path) << stats.dump();
}

}  // namespace

TEST_CASE("ranks make disturbed renders again, unless they share cores") {
    if (!can_run()) return;
    const test::TempFolder folder;
    const std::string file = folder.write("e.toml", experiment("spp = [4, 12]")), out = folder / "out";
    const std::vector<std::string> resume = {"experiment", file, "-o", out, "--resume"};
    REQUIRE(test::run(folder, {"experiment", file, "-o", out}).code == 0);
    const auto expected = sorted_rows(out);
    const std::vector<std::string> disturbed = {"/stats/cornell/bdpt_1.json", "/stats/cornell/bdpt_2.json",
                                                "/stats/glass/bdpt_1.json", "/stats/glass/bdpt_2.json"};
    for (const std::string& name : disturbed) disturb(out + name);

    REQUIRE(run_ranks(folder, 2, resume).code == 0);
    json manifest = json::parse(read_file(out + "/manifest.json"));
    CHECK(manifest["disturbed"].size() == 4);
    CHECK(test::contains(manifest["ranks_share"], "share core"));

    const std::vector<std::string> bound = two_bound_ranks(resume);
    if (bound.empty()) return skip("one core: ranks that share none are not tested");
    const test::Outcome done = test::finish(folder, test::start_program(folder, "mpirun", bound));
    INFO(done.err);
    REQUIRE(done.code == 0);
    // A rank that is bound to a core has one thread.
    const auto threadless = [](auto rows) {
        for (auto& row : rows) row[test::column("device")] = "";
        return rows;
    };
    CHECK(bool(threadless(sorted_rows(out)) == threadless(expected)));
    size_t long_enough = 0;  // to be disturbed by what else runs on this machine now
    for (const std::string& name : disturbed) {
        const json stats = json::parse(read_file(out + name));
        const double seconds = stats["seconds"]["render"];
        CHECK(seconds < 100);
        long_enough += seconds >= kShortestJudged;
        CHECK(stats["attempts"].size() == 1);
        CHECK(test::contains(done.err, "is made again: other processes held 100 %"));
    }
    manifest = json::parse(read_file(out + "/manifest.json"));
    CHECK(manifest["disturbed"].size() <= long_enough);
    CHECK(read_results(out + "/batches.csv", kBatchHeader).size() == 2 * 2 * 3 * 12);
}

TEST_CASE("ranks that share cores are refused where times are compared") {
    if (!can_run()) return;
    const test::TempFolder folder;
    const std::string file = folder.write("e.toml", experiment("seconds = [0.05]"));
    const test::Outcome refused = run_ranks(folder, 2, {"experiment", file, "-o", folder / "out"});
    CHECK(refused.code != 0);
    CHECK(test::contains(refused.err, "ranks 0 and 1 on " + host_name() + " share core"));
}

TEST_CASE("commands that would do everything once per rank are refused") {
    if (!can_run()) return;
    const test::TempFolder folder;
    const test::Outcome refused = run_ranks(folder, 2, {"--quiet", "info", test::kCornell});
    CHECK(refused.code != 0);
    CHECK(test::contains(refused.err, "info: only render and experiment work with several ranks"));
}
