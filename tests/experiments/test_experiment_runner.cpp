// libs: ambilux_experiments
// timeout: 120
// Budgets, references and the experiment runner, on a process of known mean and variance in the renderer's place.
#include <sys/wait.h>

#include "backends/cuda_device.h"
#include "core/log.h"
#include "experiments/batches.h"
#include "experiments/work_estimate.h"
#include "film/ztest.h"
#include "session/load.h"
#include "session/machine.h"
#include "session/reference.h"
#include "session/state.h"
#include "tests/support/experiment_fakes.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("an experiment leaves the files that docs/experiments.md lists") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    world.counters_restart = GENERATE(false, true);
    CHECK(run_experiment(request(folder, "out"), fake_hooks(world)) == ExitCode::done);
    const auto rows = table(folder / "out/runs.csv");
    REQUIRE(rows.size() == 2 * 2 * 2 * 4);
    CHECK(rows[0][column("scene")] == "a");
    CHECK(rows[4][column("run")] == "biased");
    CHECK(rows[15][column("seed")] == "1");  // seeds are the outer loop
    CHECK(rows[16][column("seed")] == "2");
    CHECK(rows[3][column("spp")] == "32");
    CHECK(rows[3][column("rays")] == std::to_string(32 * 16 * 12));
    CHECK(std::stod(rows[3][column("time")]) >= std::stod(rows[2][column("time")]));
    for (const char* file : {"config.resolved.toml", "manifest.json", "images/a/good_1.exr", "images/b/biased_2.png",
                             "images/a/reference.png", "stats/a/good_2.json"})
        CHECK(fs::exists(folder.path / "out" / file));
    CHECK_FALSE(fs::exists(folder.path / "out/state"));
    const auto manifest = nlohmann::json::parse(read_file(folder / "out/manifest.json"));
    CHECK(manifest["finished"].is_string());
    CHECK(manifest["format"] == 2);
    CHECK(manifest["devices"][0] == "fake device");
    CHECK(manifest["scenes"][1]["size"] == nlohmann::json({9, 5}));
    CHECK(fs::exists(folder.path / "out" / manifest["scenes"][0]["reference"]["file"].get<std::string>()));
    const auto stats = nlohmann::json::parse(read_file(folder / "out/stats/a/good_2.json"));
    CHECK(stats["spp"] == 32);
    CHECK(stats["rays"]["extend"] == 32 * 16 * 12);
    REQUIRE(stats["machine"].size() == 1);
    CHECK(stats["machine"][0]["other_cores"].get<double>() >= 0);
    CHECK(contains(manifest["commands"][0].get<std::string>(), "test_experiment_runner"));
    Attributes attributes;
    read_exr(folder / "out/images/a/good_2.exr", &attributes);
    CHECK(attributes["spp"] == 32);
    CHECK(attributes["seed"] == 2);

    // The error is that of the known process: sqrt(mean of variances/n), mean over channels of (1+c)² = 14/3; plus the
    // bias of the biased one.
    double good = 0, biased = 0;
    for (const auto& row : rows)
        if (row[column("scene")] == "a" && row[column("spp")] == "32")
            (row[column("run")] == "good" ? good : biased) += std::pow(std::stod(row[column("rmse_corrected")]), 2) / 2;
    CHECK(good == Approx(14.0 / 3 / 32).epsilon(0.3));
    CHECK(biased == Approx(14.0 / 3 * (1.21 / 32 + 0.01)).epsilon(0.3));

    SECTION("the folder is not overwritten, and nothing is left to do for --resume") {
        CHECK(contains(error_of([&] { run_experiment(request(folder, "out"), fake_hooks(world)); }, ExitCode::usage),
                       "--resume"));
        const std::string before = read_file(folder / "out/runs.csv");
        const uint64_t samples = world.samples;
        CHECK(run_experiment(request(folder, "out", true), fake_hooks(world)) == ExitCode::done);
        CHECK(world.samples == samples);
        CHECK(read_file(folder / "out/runs.csv") == before);
    }
    SECTION("a changed configuration or scene is refused by name") {
        folder.write("e.toml", std::string(kConfig).replace(std::string(kConfig).find("[1, 2]"), 6, "[1, 3]"));
        CHECK(contains(error_of([&] { run_experiment(request(folder, "out", true), fake_hooks(world)); }),
                       "'seeds = [ 1, 2 ]' there, 'seeds = [ 1, 3 ]' now"));
        write_inputs(folder);
        folder.write("b.xml", "<scene changed>");
        CHECK(contains(error_of([&] { run_experiment(request(folder, "out", true), fake_hooks(world)); }),
                       "b.xml: has changed"));
    }
    SECTION("references are kept for other experiments") {
        auto shared = request(folder, "shared1");
        shared.references = folder / "refs";
        run_experiment(shared, fake_hooks(world));
        const uint64_t samples = world.samples;
        shared.output = folder / "shared2";
        run_experiment(shared, fake_hooks(world));
        CHECK(world.samples - samples == 2 * 2 * 2 * 32);
    }
}

TEST_CASE("killed at any point and resumed, an experiment equals an uninterrupted one") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    run_experiment(request(folder, "whole"), fake_hooks(world));
    const auto expected = timeless(folder / "whole/runs.csv");
    const int calls = world.calls;
    // In references, in the middle of renders, between checkpoints, near the end.
    for (const int at : {1, 70, calls - 95, calls - 60, calls - 33, calls - 17, calls}) {
        const std::string out = "killed" + std::to_string(at);
        int kills = 0;
        for (int attempt = 0; attempt < 2; ++attempt) {
            const pid_t child = ::fork();
            REQUIRE(child >= 0);
            if (child == 0) {
                World doomed;
                doomed.kill_at = at;
                try {
                    run_experiment(request(folder, out, attempt > 0), fake_hooks(doomed));
                } catch (...) {
                    ::_exit(9);
                }
                ::_exit(0);
            }
            int status = 0;
            REQUIRE(::waitpid(child, &status, 0) == child);
            REQUIRE((WIFSIGNALED(status) || WEXITSTATUS(status) == 0));
            kills += WIFSIGNALED(status);
        }
        CAPTURE(at);
        CHECK(kills >= 1);
        append_file(folder / (out + "/runs.csv"), "a,good,1,");  // a line that was cut off
        World healthy;
        CHECK(run_experiment(request(folder, out, true), fake_hooks(healthy)) == ExitCode::done);
        CHECK(bool(timeless(folder / (out + "/runs.csv")) == expected));
        for (const char* image : {"images/a/good_1.exr", "images/b/biased_2.exr"})
            CHECK(bool(read_exr(folder / (out + "/" + image)).rgb ==
                       read_exr(folder / ("whole/" + std::string(image))).rgb));
    }
}

TEST_CASE("a signal ends an experiment with what is done saved, and resuming repeats no sample") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    world.stop_at = 300;  // in the renders: the references take 2·134 calls
    auto r = request(folder, "out");
    r.interrupt = &world.flag;
    CHECK(run_experiment(r, fake_hooks(world)) == ExitCode::interrupted);
    CHECK(fs::exists(folder.path / "out/state/a"));
    world.flag = false;
    r.resume = true;
    CHECK(run_experiment(r, fake_hooks(world)) == ExitCode::done);
    CHECK(world.samples == 2 * 400 + 8 * 32);
    CHECK(table(folder / "out/runs.csv").size() == 32);
}

TEST_CASE("a resumed render goes on with what its first part chose, and choosing takes of its time") {
    const TempFolder folder;
    std::string config = kConfig;
    config.replace(config.find("name = \"biased\"\nintegrator = \"path\"\nestimator = \"naive\""), std::string::npos,
                   "name = \"chosen\"\nintegrator = \"bdpt\"\nset = { \"bdpt.auto\" = true }\n");
    config.replace(config.find("seeds = [1, 2]"), 14, "seeds = [1]");
    write_inputs(folder, config);
    /// Each selection is another one.
    struct Choosing : FakeRenderer {
        Choosing(const Scene& scene, const RenderSettings& settings, World& world, int number)
            : FakeRenderer(scene, settings, world) {
            if (settings.automatic)
                selection = {"selection", {{"connections", std::to_string(number)}}, 1000.0, 1, 0, {}};
        }
        RenderStats stats() override {
            RenderStats s = FakeRenderer::stats();
            s.selection = selection;
            return s;
        }
        SelectionStats selection;
    };
    World world;
    Hooks hooks = fake_hooks(world);
    std::vector<RenderSettings> made;
    hooks.make_renderer = [&](const Scene& scene, const RenderSettings& settings) {
        made.push_back(settings);
        return std::make_unique<Choosing>(scene, settings, world, int(made.size()));
    };
    auto r = request(folder, "out");
    r.interrupt = &world.flag;
    // The references take 2·134 calls, the run "good" 17, of whose number the first of "chosen" on scene a is one more.
    world.stop_at = 2 * 134 + 17 + 8;
    REQUIRE(run_experiment(r, hooks) == ExitCode::interrupted);
    REQUIRE(made.back().automatic);
    const uint32_t first = uint32_t(made.size());
    world.flag = false;
    r.resume = true;
    made.clear();
    REQUIRE(run_experiment(r, hooks) == ExitCode::done);
    // Tried, rendered: the first render that is made again for "chosen" with that number of connections is the one that
    // was interrupted.
    const auto resumed = std::find_if(made.begin(), made.end(),
                                      [&](const RenderSettings& s) { return s.integrator == "bdpt" && !s.automatic; });
    REQUIRE(resumed != made.end());
    CHECK(resumed->connections == first);
    for (const auto& row : table(folder / "out/runs.csv"))
        if (row[column("run")] == "chosen") CHECK(std::stod(row[column("time")]) >= 1000.0);
    const auto stats = nlohmann::json::parse(read_file(folder / "out/stats/a/chosen_1.json"));
    CHECK(stats["selection"]["settings"]["connections"] == std::to_string(first));
    CHECK(stats["selection"]["seconds"] == 1000.0);
    // What ran is in the rows and in the statistics, and not what was asked for.
    for (const auto& row : table(folder / "out/runs.csv"))
        if (row[column("run")] == "chosen" && row[column("scene")] == "a") {
            CHECK(row[column("method")] == stats["method"].get<std::string>());
            CHECK(row[column("method")].starts_with("bdpt "));
        }
}

TEST_CASE("a render is recorded in batches of whole passes, which end at checkpoints or between them") {
    ExperimentConfig config;
    config.spp = {1, 2, 8, 32};
    const auto next = [&](uint64_t at, uint64_t checkpoint) {
        return batch_end(config, {at, 0, false}, {checkpoint, 0}).samples;
    };
    CHECK(next(0, 1) == 1);
    CHECK(next(2, 8) == 4);
    CHECK(next(6, 8) == 8);
    CHECK(next(30, 32) == 32);
    config.spp.clear();
    config.seconds = {0.1, 1.6};
    const auto later = [&](double at, double checkpoint) {
        return batch_end(config, {5, at, false}, {0, checkpoint}).seconds;
    };
    CHECK(later(0.0, 0.1) == Approx(0.1));
    CHECK(later(0.27, 1.6) == Approx(0.4));
    CHECK(later(0.22, 1.6) == Approx(0.3));
    CHECK(later(1.54, 1.6) == Approx(1.6));
    CHECK(later(1.7, 0) == Approx(1.8));          // past the last checkpoint in seconds, before one in samples
    RenderPosition slow{5, 0.27, false, 0.3, 1};  // half a sample is longer than what is left of the batch
    CHECK(batch_end(config, slow, {0, 1.6}).seconds == Approx(1.6));

    const TempFolder folder;
    write_inputs(folder);
    World world;
    REQUIRE(run_experiment(request(folder, "out"), fake_hooks(world)) == ExitCode::done);
    const auto lines = read_results(folder / "out/batches.csv", kBatchHeader);
    REQUIRE(lines.size() == 8 * 17);
    // Parts add up to the whole, and each estimates the same variance of one sample: 14/3.
    uint64_t samples = 0;
    double variance = 0;
    for (const std::string& line : lines) {
        std::istringstream in(line);
        std::vector<std::string> cells;
        for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
        REQUIRE(cells.size() == 9);
        samples += cells[1] == "good" ? std::stoull(cells[4]) : 0;
        variance += cells[1] == "good" ? std::stod(cells[6]) * std::stod(cells[4]) / (4 * 17) : 0;
    }
    CHECK(samples == 2 * 2 * 32);
    CHECK(variance == Approx(14.0 / 3).epsilon(0.15));
}

TEST_CASE("runs and scenes come in an order that the seed decides, all of them once") {
    const auto listed = render_order(2, 3, 7, false);
    CHECK(listed == std::vector<std::pair<size_t, size_t>>{{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1}, {1, 2}});
    auto random = render_order(2, 30, 7, true);
    CHECK(random == render_order(2, 30, 7, true));
    CHECK(random != render_order(2, 30, 8, true));
    std::sort(random.begin(), random.end());
    CHECK(random == render_order(2, 30, 7, false));
}

TEST_CASE("a damaged state costs the render, not the experiment") {
    const TempFolder folder;
    RenderState state{{1, 1, 2, {1, 2, 3}, {4, 5, 6}}, {{"rows", {"x"}}}, {{std::byte{9}, std::byte{8}}, {}}};
    write_state(folder / "s", state);
    const auto back = read_state(folder / "s");
    REQUIRE(back);
    CHECK(back->moments.sum == state.moments.sum);
    CHECK(back->moments.sum_squares == state.moments.sum_squares);
    CHECK(back->notes == state.notes);
    CHECK(back->devices == state.devices);
    const std::string bytes = read_file(folder / "s");
    set_quiet(true);
    for (size_t keep = 0; keep < bytes.size(); ++keep) {
        folder.write("s", bytes.substr(0, keep));
        REQUIRE_FALSE(read_state(folder / "s"));
    }
    std::string flipped = bytes;
    flipped[bytes.size() / 2] ^= 1;
    folder.write("s", flipped);
    CHECK_FALSE(read_state(folder / "s"));
    CHECK_FALSE(read_state(folder / "missing"));
    set_quiet(false);
}

TEST_CASE("time checkpoints lie within one render") {
    const TempFolder folder;
    std::string config = kConfig;
    config.replace(config.find("spp = [1, 2, 8, 32]"), 19, "seconds = [0.1, 0.3]");
    config = "repeats = 0\n" + config;  // times of a busy machine differ
    config.replace(config.find("seeds = [1, 2]"), 14, "seeds = [7]");
    write_inputs(folder, config);
    World world;
    world.batch = 50;
    Hooks hooks = fake_hooks(world);
    hooks.make_renderer = [&](const Scene& scene, const RenderSettings& settings) -> std::unique_ptr<Renderer> {
        return std::make_unique<SaysItsTime>(scene, settings, world, 0.0002);
    };
    CHECK(run_experiment(request(folder, "out"), hooks) == ExitCode::done);
    const auto rows = table(folder / "out/runs.csv");
    REQUIRE(rows.size() == 2 * 2 * 2);
    for (size_t i = 0; i < rows.size(); ++i) {
        const double budget = i % 2 ? 0.3 : 0.1, time = std::stod(rows[i][column("time")]);
        CHECK(std::abs(time - budget) <= 0.0001 + 1e-9);  // half a sample
    }
}

TEST_CASE("two processes do not share a folder; a folder that cannot be made is a device error") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    World* inner_world = &world;
    Hooks hooks = fake_hooks(world);
    std::string message;
    const auto make = hooks.make_renderer;
    bool once = false;
    hooks.make_renderer = [&](const Scene& s, const RenderSettings& settings) {
        if (fs::exists(folder.path / "out/.lock") && !once) {
            once = true;
            message = error_of([&] { run_experiment(request(folder, "out", true), fake_hooks(*inner_world)); },
                               ExitCode::device);
        }
        return make(s, settings);
    };
    run_experiment(request(folder, "out"), hooks);
    CHECK(contains(message, "another experiment is writing into"));
    folder.write("file", "");
    CHECK(contains(error_of([&] { run_experiment(request(folder, "file/out"), fake_hooks(world)); }, ExitCode::device),
                   "file/out"));
}

TEST_CASE("checkpoints in samples and in seconds lie within one render") {
    const TempFolder folder;
    std::string config = kConfig;
    config.replace(config.find("spp = [1, 2, 8, 32]"), 19, "spp = [10, 400]\nseconds = [0.05, 0.2]");
    config = "repeats = 0\n" + config;  // times of a busy machine differ
    write_inputs(folder, config);
    World world;
    world.sleep_per_sample = 0.0005;
    world.batch = 20;
    Hooks hooks = fake_hooks(world);
    const auto make = hooks.make_renderer;
    int told = 0;  // renderers that know of both budgets
    hooks.make_renderer = [&](const Scene& s, const RenderSettings& settings) {
        told += settings.expected_samples == 400 && settings.expected_seconds == 0.2;
        return make(s, settings);
    };
    CHECK(run_experiment(request(folder, "out"), hooks) == ExitCode::done);
    CHECK(told == 8);
    const auto rows = table(folder / "out/runs.csv");
    REQUIRE(rows.size() == 8 * 4);
    const size_t checkpoint = column("checkpoint"), budget = column("budget"), spp = column("spp"),
                 time = column("time");
    for (size_t i = 0; i < rows.size(); i += 4) {
        // Written in the order in which they are reached; a place in the list of checkpoints means the same in every
        // render.
        for (size_t k = 0; k + 1 < 4; ++k) CHECK(std::stod(rows[i + k][time]) <= std::stod(rows[i + k + 1][time]));
        for (size_t k = 0; k < 4; ++k) {
            const auto& row = rows[i + k];
            CHECK(row[budget] == (std::stoi(row[checkpoint]) < 2 ? "spp" : "seconds"));
            if (row[checkpoint] == "0") CHECK(row[spp] == "10");
            if (row[checkpoint] == "1") CHECK(row[spp] == "400");
            if (row[checkpoint] == "2") CHECK(std::stod(row[time]) > 0.95 * 0.05);
            if (row[checkpoint] == "3") {
                CHECK(std::stod(row[time]) > 0.95 * 0.2);
                // The image is that of the last checkpoint of the list, not the latest.
                Attributes attributes;
                read_exr(folder / ("out/images/" + row[0] + "/" + row[1] + "_" + row[2] + ".exr"), &attributes);
                CHECK(std::to_string(attributes["spp"].get<int>()) == row[spp]);
            }
        }
    }
    // One render each, nothing twice: 400 samples unless time allowed more.
    const uint64_t references = 2 * 400;
    uint64_t most = 0;
    for (size_t i = 3; i < rows.size(); i += 4) most += std::stoull(rows[i][spp]);
    CHECK(world.samples == references + most);
}

TEST_CASE(
    "a reference is found by content, extended on demand, and made by the integrator that the configuration names") {
    const TempFolder folder;
    write_inputs(folder);
    World world;
    auto r = request(folder, "one");
    r.references = folder / "refs";
    run_experiment(r, fake_hooks(world));
    const auto samples_of = [&](const std::string& config, const std::string& output) {
        folder.write("e.toml", config);
        r.output = folder / output;
        const uint64_t before = world.samples;
        run_experiment(r, fake_hooks(world));
        return world.samples - before - 8 * 32;
    };
    const auto with = [](std::string config, const std::string& from, const std::string& to) {
        return config.replace(config.find(from), from.size(), to);
    };
    CHECK(samples_of(kConfig, "two") == 0);
    CHECK(samples_of(with(kConfig, "name = \"b\"", "name = \"another\""), "three") == 0);
    CHECK(samples_of(with(kConfig, "spp = 400", "spp = 500"), "four") == 2 * 100);
    CHECK(samples_of(kConfig, "five") == 0);  // 500 serve for 400
    CHECK(samples_of(with(kConfig, "size = [9, 5]", "size = [9, 5]\nmax_depth = 3"), "six") == 400);
    CHECK(samples_of(with(kConfig, "spp = 400", "spp = 400\nintegrator = \"bdpt\"\nvariant = \"lvc\""), "seven") ==
          2 * 400);
    const auto manifest = nlohmann::json::parse(read_file(folder / "seven/manifest.json"));
    CHECK(manifest["scenes"][0]["reference"]["integrator"] == "bdpt");
    CHECK(manifest["scenes"][0]["reference"]["settings"] == "integrator=bdpt variant=lvc");
    Attributes attributes;
    read_reference_exr(manifest["scenes"][0]["reference"]["file"].get<std::string>(), &attributes);
    CHECK(attributes["integrator"] == "bdpt");
    CHECK(samples_of(with(kConfig, "size = [9, 5]",
                          "size = [9, 5]\nreference = { integrator = \"bdpt\", variant = \"lvc\", spp = 450 }"),
                     "eight") == 50);
    // A copy of the scene under another name has the same content.
    folder.write("copy.xml", "<scene b>");
    CHECK(samples_of(with(kConfig, "path = \"b.xml\"", "path = \"copy.xml\""), "nine") == 0);
    // Twice in one experiment, too.
    r.references = folder / "fresh";
    CHECK(samples_of(with(kConfig, "path = \"b.xml\"\nsize = [9, 5]", "path = \"a.xml\""), "ten") == 400);
}

TEST_CASE("a render that gathers images of single strategies starts over when it was killed") {
    const TempFolder folder;
    std::string config = kConfig;
    config.replace(config.find("estimator = \"naive\""), 19,
                   "sweep = { rr_depth = [1, 2], connections = [3] }\ntechniques = 4");
    write_inputs(folder, config);
    World world;
    run_experiment(request(folder, "whole"), fake_hooks(world));
    const std::string name = "techniques/a/biased[rr_depth=2,connections=3]_1/raw_s00_t02.exr";
    const Image image = read_exr(folder / ("whole/" + name));
    CHECK(image.rgb[0] == 32);
    CHECK_FALSE(fs::exists(folder.path / "whole/techniques/a/good_1"));
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
        World doomed;
        doomed.kill_at = 2 * 134 + 3 * 13 - 2;  // in the third render, which is of this kind
        run_experiment(request(folder, "out"), fake_hooks(doomed));
        ::_exit(0);
    }
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFSIGNALED(status));
    const auto before = read_results(folder / "out/runs.csv").size();
    CHECK(before % 4 == 0);
    CHECK(run_experiment(request(folder, "out", true), fake_hooks(world)) == ExitCode::done);
    CHECK(bool(read_exr(folder / ("out/" + name)).rgb == image.rgb));
    CHECK(bool(timeless(folder / "out/runs.csv") == timeless(folder / "whole/runs.csv")));
    const auto manifest = nlohmann::json::parse(read_file(folder / "out/manifest.json"));
    CHECK(manifest["runs"][2]["sweep"] ==
          nlohmann::json({{"of", "biased"}, {"values", {{"connections", "3"}, {"rr_depth", "2"}}}}));
    CHECK(manifest["runs"][2]["techniques"] == 4);
}
