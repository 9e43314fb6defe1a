// libs: ambilux_experiments
// timeout: 60
// Renders that others disturbed: noticed by what was recorded of them, made again, up to a limit.
#include "experiments/disturbed.h"

#include "session/drive.h"
#include "session/gpu_watch.h"
#include "tests/support/experiment_fakes.h"

using namespace ambilux;
using namespace ambilux::test;
using nlohmann::json;

// In the place of the driver's library (nvml.h): this program is opened as one.
namespace {
int looks = 0, ended = 0;
int device_of_test = 0;
}  // namespace

extern "C" {
int nvmlInit_v2() { return 0; }
int nvmlShutdown() { return ++ended, 0; }
int nvmlDeviceGetHandleByPciBusId_v2(const char* id, void** device) {
    *device = &device_of_test;
    return std::string(id) == "0000:65:00.0" ? 0 : 6;
}
int nvmlDeviceGetClockInfo(void* device, int type, unsigned* mhz) {
    *mhz = device == &device_of_test ? (type == 1 ? (looks++ == 0 ? 1980 : 1400) : 2619) : 0;
    return 0;
}
int nvmlDeviceGetTemperature(void*, int, unsigned* celsius) { return *celsius = 61, 0; }
int nvmlDeviceGetPowerUsage(void*, unsigned* milliwatts) { return *milliwatts = 450000, 0; }
int nvmlDeviceGetCurrentClocksThrottleReasons(void*, unsigned long long* bits) {
    return *bits = looks > 1 ? 0x21 : 0x1, 0;  // idle; then idle and thermal
}
}

namespace {

json stats_of(double seconds, double spp, double others = 0, const std::string& method = "path") {
    return {{"spp", spp},
            {"method", method},
            {"seconds", {{"render", seconds}}},
            {"machine", {{{"seconds", seconds}, {"cores", 4}, {"other_cores", others}, {"gpu", nullptr}}}}};
}

}  // namespace

TEST_CASE(
    "a render is disturbed by others on the cores, a device that is held down, or samples slower than elsewhere") {
    const double least = 0.1;
    CHECK(why_disturbed(stats_of(1, 10), least).empty());
    CHECK(why_disturbed(stats_of(1.1, 10, 0.39), least).empty());
    CHECK(why_disturbed(stats_of(1, 10, 0.5), least) == "other processes held 12 % of the cores");
    CHECK(why_disturbed(stats_of(2, 10), least) == "a sample took 2.00 times as long as with another seed");
    CHECK(why_disturbed(stats_of(2, 10), 0).empty());          // nothing to compare with
    CHECK(why_disturbed(stats_of(0.1, 0.1, 3), 0.1).empty());  // too short to tell
    json hot = stats_of(1, 10);
    hot["machine"][0]["gpu"] = {{"slowdowns", {"power cap"}}};
    CHECK(why_disturbed(hot, least).empty());
    hot["machine"][0]["gpu"] = {{"slowdowns", {"power cap", "thermal"}}};
    CHECK(contains(why_disturbed(hot, least), "held down: thermal"));
    CHECK(why_disturbed(json::object(), least).empty());  // of an older version
    // Other methods, and renders too short to tell, are no measure.
    const auto found =
        least_seconds({stats_of(1, 10), stats_of(2, 10), stats_of(3, 10, 0, "bdpt"), stats_of(0.01, 10), nullptr});
    CHECK(found == std::map<std::string, double>{{time_class(stats_of(1, 1)), 0.1},
                                                 {time_class(stats_of(1, 1, 0, "bdpt")), 0.3}});
}

TEST_CASE("times are compared between equal devices, those of CPUs on one host alone, and ranks are no others") {
    const auto on = [](const std::string& backend, const std::string& device, const std::string& host) {
        json stats = stats_of(1, 10);
        stats["backend"] = backend;
        stats["device"] = device;
        stats["machine"][0]["host"] = host;
        return time_class(stats);
    };
    CHECK(on("cuda", "H100", "a") == on("cuda", "H100", "b"));
    CHECK(on("cuda", "H100", "a") != on("cuda", "H200", "a"));
    CHECK(on("cpu", "CPU, 8 threads", "a") != on("cpu", "CPU, 8 threads", "b"));
    CHECK(on("cpu", "CPU, 8 threads", "a") != on("cpu", "CPU, 4 threads", "a"));
    CHECK(on("cpu", "CPU, 8 threads", "a") == on("cpu", "CPU, 8 threads", "a"));

    LoadReading before, after;
    after.wall = 2;
    after.busy = 10;
    after.own = 2;
    after.ranks = 6;
    CHECK(other_cores(before, after) == Approx(1));
    CHECK(load_json(before, after)["rank_cores"] == Approx(3));
}

TEST_CASE("the driver's library says what the device did") {
    GpuReadings readings;
    CHECK(readings.json().is_null());
    CHECK_FALSE(Nvml("").is_there());
    CHECK_FALSE(Nvml("0000:65:00.0", "no-such-library.so").is_there());
    CHECK_FALSE(Nvml("0000:99:00.0", nullptr).is_there());
    CHECK(Nvml("", nullptr).read().sm_mhz == 0);
    looks = ended = 0;
    {
        const Nvml nvml("0000:65:00.0", nullptr);
        REQUIRE(nvml.is_there());
        for (int i = 0; i < 2; ++i) readings.add(nvml.read());
    }
    CHECK(ended == 1);
    const json said = readings.json();
    CHECK(said["readings"] == 2);
    CHECK(said["sm_mhz"] == json({{"lowest", 1400.0}, {"mean", 1690.0}, {"highest", 1980.0}}));
    CHECK(said["memory_mhz"] == 2619.0);
    CHECK(said["celsius"] == 61.0);
    CHECK(said["watts"] == Approx(450));
    CHECK(said["slowdowns"] == json({"thermal"}));
    CHECK(slowdowns(0).empty());
    CHECK(slowdowns(0x78) == std::vector<std::string>{"hardware", "thermal", "thermal (hardware)"});
    CHECK(slowdowns(0x84) == std::vector<std::string>{"power cap", "power brake"});
}

namespace {

constexpr const char* kThreeSeeds = R"(repeats = 2
seeds = [1, 2, 3]
order = "listed"
[reference]
spp = 100
[budget]
spp = [20, 100]
[[scene]]
name = "a"
path = "a.xml"
[[run]]
name = "good"
integrator = "path"
)";

/// Samples of seed 2 are slow in its first `slow` renders; `on_second` is called when it is made again.
struct Slowed {
    World world;
    int slow, made = 0;
    std::function<void()> on_second;

    Hooks hooks() {
        Hooks h = fake_hooks(world);
        world.batch = 25;
        h.make_renderer = [this](const Scene& scene, const RenderSettings& settings) -> std::unique_ptr<Renderer> {
            const bool two = settings.seed == 2;
            made += two;
            if (two && made == 2 && on_second) on_second();
            return std::make_unique<SaysItsTime>(scene, settings, world, two && made <= slow ? 0.009 : 0.003);
        };
        return h;
    }
};

}  // namespace

TEST_CASE("a slow render is made again, and one that stays slow no more often than allowed") {
    const TempFolder folder;
    write_inputs(folder, kThreeSeeds);
    Slowed slowed;
    slowed.slow = GENERATE(1, 1000);
    const bool once = slowed.slow == 1;
    CHECK(run_experiment(request(folder, "out"), slowed.hooks()) == ExitCode::done);
    CHECK(slowed.made == (once ? 2 : 3));
    CHECK(table(folder / "out/runs.csv").size() == 3 * 2);
    const json stats = json::parse(read_file(folder / "out/stats/a/good_2.json"));
    REQUIRE(stats["attempts"].size() == (once ? 1 : 2));
    CHECK(stats["attempts"][0]["why"] == "a sample took 3.00 times as long as with another seed");
    CHECK(stats["attempts"][0]["seconds_per_sample"] == Approx(0.009));
    CHECK(stats["spp"] == 100);
    CHECK(stats["seconds"]["render"] == Approx(once ? 0.3 : 0.9));
    const json manifest = json::parse(read_file(folder / "out/manifest.json"));
    CHECK(manifest["repeats"] == 2);
    REQUIRE(manifest["disturbed"].size() == (once ? 0 : 1));
    if (!once) CHECK(manifest["disturbed"][0]["made"] == 3);
    CHECK_FALSE(fs::exists(folder / "out/state"));
}

TEST_CASE("repeats = 0 makes nothing again") {
    const TempFolder folder;
    std::string config = kThreeSeeds;
    write_inputs(folder, config.replace(config.find("= 2"), 3, "= 0"));
    Slowed slowed;
    slowed.slow = 1;
    CHECK(run_experiment(request(folder, "out"), slowed.hooks()) == ExitCode::done);
    CHECK(slowed.made == 1);
    CHECK(json::parse(read_file(folder / "out/manifest.json"))["disturbed"].size() == 1);
}

TEST_CASE("a render whose repetition was interrupted is made again when the experiment is resumed") {
    const TempFolder folder;
    write_inputs(folder, kThreeSeeds);
    Slowed slowed;
    slowed.slow = 1;
    volatile bool stop = false;
    slowed.on_second = [&] { set_flag(&stop); };  // before the first sample of the repetition
    ExperimentRequest first = request(folder, "out");
    first.interrupt = &stop;
    CHECK(run_experiment(first, slowed.hooks()) == ExitCode::interrupted);
    CHECK(table(folder / "out/runs.csv").size() == 2 * 2);
    CHECK(run_experiment(request(folder, "out", true), slowed.hooks()) == ExitCode::done);
    CHECK(table(folder / "out/runs.csv").size() == 3 * 2);
    const json stats = json::parse(read_file(folder / "out/stats/a/good_2.json"));
    CHECK(stats["attempts"].size() == 1);  // what was known when it was begun
    CHECK(stats["seconds"]["render"] == Approx(0.3));
}
