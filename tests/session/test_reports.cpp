// libs: ambilux_experiments
// timeout: 60
// What a render says about itself: statistics, their sums and their saved form, tables, frame times, strategy images.
#include "integrators/registry.h"
#include "integrators/setting.h"
#include "session/bench_frames.h"
#include "session/render_plan.h"
#include "session/statistics.h"
#include "session/stats_sum.h"
#include "session/technique_files.h"
#include "tests/support/experiment_fakes.h"

using namespace ambilux;
using namespace ambilux::test;
using nlohmann::json;

namespace {

StageStats stage(const char* name, uint64_t launches, uint64_t items, double seconds, std::vector<uint64_t> by_depth) {
    return {name, launches, items, seconds, std::move(by_depth)};
}

/// No two numbers are alike that stand side by side.
RenderStats some_stats() {
    RenderStats s;
    s.backend = "cuda";
    s.device = "H100";
    s.accel = "cwbvh";
    s.settings.integrator = "bdpt";
    s.settings.variant = "learned";
    apply_setting(s.settings, "connections", "7");
    apply_setting(s.settings, "seed", "1099511627777");
    for (const Setting& own : variant_of(s.settings).own) s.settings.own[own.what.key] = own.text(s.settings);
    s.device_seconds = 0.25;
    s.build_seconds = 1.5;
    s.structure_seconds = 0.5;
    s.kernel_seconds = 0.125;
    s.render_seconds = 20.25;
    s.samples = 64;
    s.wave_paths = 4096;
    s.rays_extend = 3000;
    s.rays_occlude = 1050;
    s.stages = {stage("extend", 3, 700, 2.5, {400, 200, 100}), stage("shade", 4, 0, 1.5, {})};
    s.queues = {{"hits", 100, 90, 2}, {"splats", 50, 20, 1}};
    s.invalid = {11, 12, 13, 14};
    s.invalid_by_stage = {{"connect", {1, 2, 3, 4}}, {"shade", {10, 9, 8, 7}}};
    s.memory_bytes = 1000;
    s.memory_bytes_predicted = 900;
    s.memory_bytes_peak = 1100;
    s.features = {"diffuse", "point"};
    s.skipped = {"sky", "lens"};
    s.selection = {"bdpt, lvc",
                   {{"integrator", "bdpt"}, {"connections", "2"}},
                   0.25,
                   8192,
                   640,
                   {{"path", "integrator=path", double(kInfinity), 3, 0, 0, "cannot find light"},
                    {"bdpt, lvc", "integrator=bdpt", 0.5, 4.5, 0.125, 1, ""}}};
    return s;
}

json counts(uint64_t nan, uint64_t inf, uint64_t negative, uint64_t underflow) {
    return {{"nan", nan}, {"inf", inf}, {"negative", negative}, {"underflow", underflow}};
}

void check_same(const InvalidCounts& a, const InvalidCounts& b) {
    CHECK(a.nan == b.nan);
    CHECK(a.inf == b.inf);
    CHECK(a.negative == b.negative);
    CHECK(a.underflow == b.underflow);
}

void check_same(const StageStats& a, const StageStats& b) {
    CHECK(a.name == b.name);
    CHECK(a.launches == b.launches);
    CHECK(a.items == b.items);
    CHECK(a.seconds == b.seconds);
    CHECK(a.items_by_depth == b.items_by_depth);
}

void check_same(const QueueStats& a, const QueueStats& b) {
    CHECK(a.name == b.name);
    CHECK(a.capacity == b.capacity);
    CHECK(a.peak == b.peak);
    CHECK(a.overflow == b.overflow);
}

void check_same(const SelectionStats& a, const SelectionStats& b) {
    CHECK(a.name == b.name);
    CHECK(a.settings == b.settings);
    CHECK(a.seconds == b.seconds);
    CHECK(a.pilot_samples == b.pilot_samples);
    CHECK(a.expected_samples == b.expected_samples);
    REQUIRE(a.candidates.size() == b.candidates.size());
    for (size_t i = 0; i < a.candidates.size(); ++i) {
        const SelectionStats::Candidate &c = a.candidates[i], &d = b.candidates[i];
        CHECK(c.name == d.name);
        CHECK(c.settings == d.settings);
        CHECK(c.variance == d.variance);
        CHECK(c.work == d.work);
        CHECK(c.seconds == d.seconds);
        CHECK(c.efficiency == d.efficiency);
        CHECK(c.excluded == d.excluded);
    }
}

void check_same(const RenderStats& a, const RenderStats& b) {
    CHECK(a.backend == b.backend);
    CHECK(a.device == b.device);
    CHECK(a.accel == b.accel);
    for (const Setting& s : general_settings()) {
        CAPTURE(s.what.key);
        CHECK(s.text(a.settings) == s.text(b.settings));
    }
    CHECK(a.settings.own == b.settings.own);
    CHECK(a.device_seconds == b.device_seconds);
    CHECK(a.build_seconds == b.build_seconds);
    CHECK(a.structure_seconds == b.structure_seconds);
    CHECK(a.kernel_seconds == b.kernel_seconds);
    CHECK(a.render_seconds == b.render_seconds);
    CHECK(a.samples == b.samples);
    CHECK(a.wave_paths == b.wave_paths);
    CHECK(a.rays_extend == b.rays_extend);
    CHECK(a.rays_occlude == b.rays_occlude);
    REQUIRE(a.stages.size() == b.stages.size());
    for (size_t i = 0; i < a.stages.size(); ++i) check_same(a.stages[i], b.stages[i]);
    REQUIRE(a.queues.size() == b.queues.size());
    for (size_t i = 0; i < a.queues.size(); ++i) check_same(a.queues[i], b.queues[i]);
    check_same(a.invalid, b.invalid);
    REQUIRE(a.invalid_by_stage.size() == b.invalid_by_stage.size());
    for (const auto& [name, invalid] : a.invalid_by_stage) check_same(invalid, b.invalid_by_stage.at(name));
    CHECK(a.memory_bytes == b.memory_bytes);
    CHECK(a.memory_bytes_predicted == b.memory_bytes_predicted);
    CHECK(a.memory_bytes_peak == b.memory_bytes_peak);
    CHECK(a.features == b.features);
    CHECK(a.skipped == b.skipped);
    check_same(a.selection, b.selection);
}

Scene small_scene(uint32_t width, uint32_t height) {
    Scene scene;
    scene.path = "room.xml";
    scene.content_hash[0] = 0xab;
    scene.sensor.crop_width = width;
    scene.sensor.crop_height = height;
    return scene;
}

/// Keeps what it was asked for.
struct FrameRenderer : FakeRenderer {
    using FakeRenderer::FakeRenderer;
    uint32_t iteration = 1;
    size_t stop_in = 0, stop_after = 0;  ///< frames, counted from 1
    std::vector<uint32_t> firsts, before;
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        CHECK(count == iteration);
        before.push_back(uint32_t(film().samples));
        firsts.push_back(first);
        if (firsts.size() == stop_in) return 0;
        const uint32_t done = FakeRenderer::render(first, count, interrupt);
        if (firsts.size() == stop_after) set_flag(&stop);
        return done;
    }
    uint32_t iteration_samples() const override { return iteration; }
    volatile bool stop = false;
};

}  // namespace

TEST_CASE("saved statistics come back with every field") {
    const RenderStats stats = some_stats();
    REQUIRE_FALSE(stats.settings.own.empty());
    check_same(restore_stats(json::parse(save_stats(stats).dump())), stats);
    json older = save_stats(stats);
    older.erase("wave_paths");
    for (json& candidate : older["selection"][5]) candidate.erase(6);
    const RenderStats restored = restore_stats(older);
    CHECK(restored.wave_paths == 0);
    CHECK(restored.selection.candidates.at(0).excluded.empty());
    CHECK(restored.selection.candidates.at(0).efficiency == 0);
    CHECK(restored.selection.candidates.at(1).efficiency == 1);
}

TEST_CASE("a part adds its counts, times and rays to a total, the higher peak of queues, and its own state") {
    RenderStats total = some_stats(), before = some_stats(), now = some_stats();
    now.backend = "cpu";
    now.samples = 80;
    now.render_seconds = 23.5;
    now.rays_extend = 3500;
    now.rays_occlude = 1053;
    now.memory_bytes = 1200;
    now.memory_bytes_peak = 1050;
    now.stages = {stage("shade", 6, 25, 2.25, {20, 5}), stage("extend", 5, 1000, 4, {500, 300, 150, 50}),
                  stage("splat", 1, 2, 0.5, {2})};
    now.queues = {{"hits", 120, 95, 6}, {"splats", 60, 10, 1}, {"rays", 10, 5, 3}};
    now.invalid = {12, 14, 16, 18};
    now.invalid_by_stage = {{"connect", {3, 5, 7, 9}}, {"splat", {1, 2, 3, 4}}};
    now.selection = {};
    add_part(total, before, now);

    RenderStats sum = now;
    sum.render_seconds = 23.5;  // 20.25 + 3.25
    sum.rays_extend = 3500;
    sum.rays_occlude = 1053;
    sum.memory_bytes_peak = 1100;
    sum.stages = {stage("extend", 5, 1000, 4, {500, 300, 150, 50}), stage("shade", 6, 25, 2.25, {20, 5}),
                  stage("splat", 1, 2, 0.5, {2})};
    sum.queues = {{"hits", 120, 95, 6}, {"splats", 60, 20, 1}, {"rays", 10, 5, 3}};
    sum.invalid = {12, 14, 16, 18};
    sum.invalid_by_stage = {{"connect", {3, 5, 7, 9}}, {"shade", {10, 9, 8, 7}}, {"splat", {1, 2, 3, 4}}};
    sum.selection = some_stats().selection;
    check_same(total, sum);

    // Once more, from nothing before it: all of it is added.
    add_part(total, {}, now);
    sum.render_seconds = 47;
    sum.rays_extend = 7000;
    sum.rays_occlude = 2106;
    sum.stages = {stage("extend", 10, 2000, 8, {1000, 600, 300, 100}), stage("shade", 12, 50, 4.5, {40, 10}),
                  stage("splat", 2, 4, 1, {4})};
    sum.queues = {{"hits", 120, 95, 12}, {"splats", 60, 20, 2}, {"rays", 10, 5, 6}};
    sum.invalid = {24, 28, 32, 36};
    sum.invalid_by_stage = {{"connect", {6, 10, 14, 18}}, {"shade", {10, 9, 8, 7}}, {"splat", {2, 4, 6, 8}}};
    check_same(total, sum);
}

TEST_CASE("devices that render together add up their memory, and the slowest build counts") {
    RenderStats a = some_stats(), b = some_stats();
    b.build_seconds = 0.5;
    b.kernel_seconds = 0.25;
    b.memory_bytes = 2000;
    b.memory_bytes_predicted = 1900;
    b.memory_bytes_peak = 2100;
    RenderStats earlier = some_stats();
    earlier.memory_bytes_peak = 9999;
    const RenderStats sum = sum_of_devices(earlier, {{"one", a}, {"one", b}}, false);
    CHECK(sum.device == "2 x H100");
    CHECK(sum.build_seconds == 1.5);
    CHECK(sum.kernel_seconds == 0.25);
    CHECK(sum.memory_bytes == 3000);
    CHECK(sum.memory_bytes_predicted == 2800);
    CHECK(sum.memory_bytes_peak == 3200);
    CHECK(sum.render_seconds == 3 * 20.25);
    CHECK(sum.rays_extend == 9000);
    CHECK(sum_of_devices({}, {{"one", a}}, false).device == "H100");
    CHECK(sum_of_devices({}, {{"one", a}}, true).device == "one: H100");
    CHECK(sum_of_devices({}, {{"one", a}, {"two", b}}, false).device == "one: H100; two: H100");
    b.device = "CPU, 2 threads";
    CHECK(sum_of_devices({}, {{"one", b}, {"one", a}, {"one", a}}, false).device ==
          "one: CPU, 2 threads; 2 x one: H100");
}

TEST_CASE("the table of stages: shares of their sum, times of an item, and the render") {
    CHECK(stage_table(some_stats()) ==
          "stage               seconds   share   launches          items    ns/item\n"
          "extend               2.5000   62.5%          3            700 3571428.57\n"
          "shade                1.5000   37.5%          4              0       0.00\n"
          "all stages           4.0000\n"
          "render              20.2500\n");
    RenderStats none;
    none.stages = {stage("extend", 0, 5, 0, {})};
    CHECK(stage_table(none) ==
          "stage               seconds   share   launches          items    ns/item\n"
          "extend               0.0000    0.0%          0              5       0.00\n"
          "all stages           0.0000\n"
          "render               0.0000\n");
}

TEST_CASE("statistics as JSON hold what the render counted, under the names that are documented") {
    const RenderStats stats = some_stats();
    const Scene scene = small_scene(5, 3);
    RenderSettings asked = stats.settings;
    asked.automatic = true;
    const json told = stats_json(scene, asked, stats, 0.75);
    CHECK(told["scene"] == "room.xml");
    CHECK(told["scene_hash"] == "ab" + std::string(62, '0'));
    CHECK(told["backend"] == "cuda");
    CHECK(told["device"] == "H100");
    CHECK(told["accel"] == "cwbvh");
    CHECK(told["size"] == json({5, 3}));
    CHECK(told["spp"] == 64);
    CHECK(told["wave_paths"] == 4096);
    CHECK(told["seconds"] == json({{"load", 0.75},
                                   {"device", 0.25},
                                   {"build", 1.5},
                                   {"structure", 0.5},
                                   {"kernels", 0.125},
                                   {"render", 20.25}}));
    CHECK(told["rays"] == json({{"extend", 3000}, {"occlude", 1050}}));
    CHECK(told["rays_per_second"] == 200.0);
    CHECK(told["stages"] == json::parse(R"([
        {"name": "extend", "launches": 3, "items": 700, "seconds": 2.5, "items_by_depth": [400, 200, 100]},
        {"name": "shade", "launches": 4, "items": 0, "seconds": 1.5, "items_by_depth": []}])"));
    CHECK(told["queues"] == json::parse(R"([{"name": "hits", "capacity": 100, "peak": 90, "overflow": 2},
        {"name": "splats", "capacity": 50, "peak": 20, "overflow": 1}])"));
    json invalid = counts(11, 12, 13, 14);
    invalid["by_stage"] = {{"connect", counts(1, 2, 3, 4)}, {"shade", counts(10, 9, 8, 7)}};
    CHECK(told["invalid"] == invalid);
    CHECK(told["memory_bytes"] == 1000);
    CHECK(told["memory_bytes_predicted"] == 900);
    CHECK(told["memory_bytes_peak"] == 1100);
    CHECK(told["features"] == json({"diffuse", "point"}));
    CHECK(told["skipped"] == json({"sky", "lens"}));
    CHECK(told["selection"] == json::parse(R"({"name": "bdpt, lvc", "seconds": 0.25, "pilot_samples": 8192,
        "expected_samples": 640.0, "settings": {"integrator": "bdpt", "connections": "2"}, "candidates": [
        {"name": "path", "settings": "integrator=path", "variance": null, "work": 3.0, "seconds_per_sample": null,
         "efficiency": 0.0, "excluded": "cannot find light"},
        {"name": "bdpt, lvc", "settings": "integrator=bdpt", "variance": 0.5, "work": 4.5,
         "seconds_per_sample": 0.125, "efficiency": 1.0, "excluded": null}]})"));
    // Chosen: what was asked for has been replaced.
    CHECK(told["asked"]["connections"] == 7);
    CHECK(told["asked"]["bdpt.auto"] == true);
    CHECK(told["connections"] == 2);
    CHECK(told["bdpt.auto"] == false);
    CHECK(selection_line(stats.selection) == "--set integrator=bdpt --set connections=2");
    CHECK(selection_line({}).empty());

    RenderStats plain = stats;
    plain.selection = {};
    plain.render_seconds = 0;
    const json other = stats_json(scene, stats.settings, plain, 0);
    CHECK(other["selection"].is_null());
    CHECK(other["rays_per_second"] == 0.0);
    CHECK(other["connections"] == 7);

    const Attributes image = image_attributes(scene, asked, stats);
    CHECK(image["seconds"] == 20.25);
    CHECK(image["spp"] == 64);
    CHECK(image["wave_paths"] == 4096);
    CHECK(image["memory_bytes"] == 900);
    CHECK(image["memory_bytes_peak"] == 1100);
    CHECK(image["features"] == "diffuse point");
    CHECK(image["selection"] == "--set integrator=bdpt --set connections=2");
    CHECK(image["connections"] == 2);
    CHECK(json::parse(image["settings"].get<std::string>())["connections"] == 2);
    CHECK_FALSE(image_attributes(scene, stats.settings, plain).contains("selection"));
}

TEST_CASE("half of the frames take no longer than their median, and 19 of 20 no longer than the late ones") {
    FrameTimes times;
    CHECK(times.median() == 0);
    CHECK(times.late() == 0);
    times.seconds = {7};
    CHECK(times.median() == 7);
    CHECK(times.late() == 7);
    times.seconds = {3, 1, 2};
    CHECK(times.median() == 2);
    CHECK(times.late() == 3);
    times.seconds.clear();
    for (int i = 40; i > 0; --i) times.seconds.push_back(i);
    CHECK(times.median() == 20);
    CHECK(times.late() == 38);
}

TEST_CASE("frames are new images of one iteration each, and the first ones are not timed") {
    World world;
    world.sleep_per_sample = 1e-3;
    const Scene scene = small_scene(2, 1);
    FrameRenderer renderer(scene, {}, world);
    renderer.iteration = 2;
    const FrameTimes times = time_frames(renderer, 4, nullptr);
    CHECK(renderer.firsts == std::vector<uint32_t>{0, 2, 4, 6, 8, 10, 12});
    CHECK(renderer.before == std::vector<uint32_t>(7, 0));
    REQUIRE(times.seconds.size() == 4);
    for (const double seconds : times.seconds) CHECK(seconds >= 2e-3);
    CHECK(bool(times.rgb == mean_image(renderer.film()).rgb));
    CHECK(times.rgb.size() == 6);

    world.sleep_per_sample = 0;
    FrameRenderer stopped(scene, {}, world);
    stopped.stop_after = 5;
    CHECK(time_frames(stopped, 10, &stopped.stop).seconds.size() == 2);
    CHECK(stopped.firsts.size() == 5);
    FrameRenderer inside(scene, {}, world);
    inside.stop_in = 5;  // whose image is not whole
    CHECK(time_frames(inside, 10, nullptr).seconds.size() == 1);
    CHECK(inside.firsts.size() == 5);
}

TEST_CASE("images of strategies are listed with their means, and the longest paths among them") {
    const TempFolder folder;
    RenderStats stats = some_stats();
    stats.selection = {};
    const std::vector<float> raw = {1, 2, 3, 4, 5, 6}, weighted = {0, 1, 0, 1, 0, 1};
    write_technique_images(folder / "t", small_scene(2, 1), stats.settings, stats,
                           {{1, 2, false, raw, weighted, 3},
                            {3, 4, true, weighted, raw, 0},
                            {0, 2, false, weighted, {0, 0, 0, 0, 0, 0}, 1}});
    const json list = json::parse(read_file(folder / "t/techniques.json"));
    CHECK(list == json::parse(R"({"scene": "room.xml", "integrator": "bdpt", "variant": "learned", "spp": 64,
        "max_depth": 5, "width": 2, "height": 1, "entries": [
        {"s": 1, "t": 2, "merge": false, "raw": "raw_s01_t02.exr", "weighted": "weighted_s01_t02.exr",
         "mean_raw": 3.5, "mean_weighted": 0.5, "dropped": 3},
        {"s": 3, "t": 4, "merge": true,
         "raw": "raw_merge_s03_t04.exr", "weighted": "weighted_merge_s03_t04.exr",
         "mean_raw": 0.5, "mean_weighted": 3.5, "dropped": 0},
        {"s": 0, "t": 2, "merge": false, "raw": "raw_s00_t02.exr", "weighted": "weighted_s00_t02.exr",
         "mean_raw": 0.5, "mean_weighted": 0.0, "dropped": 1}]})"));
    Attributes said;
    CHECK(bool(read_exr(folder / "t/raw_merge_s03_t04.exr", &said).rgb == weighted));
    CHECK(said["s"] == 3);
    CHECK(said["t"] == 4);
    CHECK(said["merge"] == 1);
    CHECK(said["technique"] == "raw");
    CHECK(bool(read_exr(folder / "t/weighted_merge_s03_t04.exr", &said).rgb == raw));
    CHECK(said["technique"] == "weighted");
}

TEST_CASE("values that were dropped and items that were lost are told stage by stage and queue by queue") {
    CHECK(
        lost_values(some_stats()) ==
        "stage connect dropped 1 NaN, 2 Inf, 3 negative values; stage shade dropped 10 NaN, 9 Inf, 8 negative values; "
        "queue hits of capacity 100 lost 2 items; queue splats of capacity 50 lost 1 items");
    RenderStats stats;
    CHECK(lost_values(stats).empty());
    stats.invalid.underflow = 5;
    stats.invalid_by_stage["shade"].underflow = 5;
    CHECK(lost_values(stats).empty());  // no error by itself
    stats.invalid.inf = 2;
    CHECK(lost_values(stats) == "0 NaN, 2 Inf, 0 negative values were dropped");
}

TEST_CASE("a render ends by samples or by time, and by the samples of its scene where nothing is said") {
    Scene scene = small_scene(2, 1);
    scene.integrator.spp = 12;
    scene.integrator.type = "bdpt";
    scene.integrator.max_depth = 7;
    scene.integrator.rr_depth = 3;
    const auto budget = [&](std::optional<uint64_t> spp, std::optional<double> time) {
        const Budget b = render_budget(spp, time, scene, "--");
        return std::pair(b.samples, b.seconds);
    };
    CHECK(budget({}, {}) == std::pair(uint64_t(12), 0.0));
    CHECK(budget(3, {}) == std::pair(uint64_t(3), 0.0));
    CHECK(budget({}, 0.5) == std::pair(uint64_t(0), 0.5));
    scene.integrator.spp = 0;
    CHECK(budget({}, {}) == std::pair(uint64_t(1), 0.0));
    const auto refused = [&](std::optional<uint64_t> spp, std::optional<double> time) {
        return error_of([&] { budget(spp, time); }, ExitCode::usage);
    };
    CHECK(refused(3, 0.5) == "--spp and --time exclude each other: a render ends by one of them");
    CHECK(refused(0, {}) == "--spp 0: at least one sample per pixel is needed");
    for (const double time : {0.0, -1.0, double(kInfinity), std::nan("")})
        CHECK(refused({}, time) == "--time: more than zero seconds are needed");
    RenderSettings settings = default_settings(scene);
    CHECK(settings.integrator == "bdpt");
    CHECK(settings.max_depth == 7);
    CHECK(settings.rr_depth == 3);
    expect(settings, {9, 0.25});
    CHECK(settings.expected_samples == 9);
    CHECK(settings.expected_seconds == 0.25);
    World world;
    FakeRenderer plain(scene, {}, world);
    CHECK(first_position(plain).seconds == 0);
    struct Chose : FakeRenderer {
        using FakeRenderer::FakeRenderer;
        RenderStats stats() override { return some_stats(); }
    };
    Chose chose(scene, {}, world);
    CHECK(first_position(chose).seconds == 0.25);
    CHECK(first_position(chose).samples == 0);
}
