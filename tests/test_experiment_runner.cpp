// libs: ambilux_experiments
// timeout: 120
// Budgets, references and the experiment runner, on a process of known mean and variance in the renderer's place.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/log.h"
#include "core/rng.h"
#include "experiments/results.h"
#include "experiments/reference.h"
#include "experiments/runner.h"
#include "experiments/state.h"
#include "film/ztest.h"
#include "tests/catch.h"

using namespace ambilux;
namespace fs = std::filesystem;

namespace {

struct Folder {
    fs::path path;
    Folder() {
        std::string name = (fs::temp_directory_path() / "ambilux-run-XXXXXX").string();
        REQUIRE(::mkdtemp(name.data()));
        path = name;
    }
    ~Folder() {
        std::error_code ignored;
        fs::remove_all(path, ignored);
    }
    std::string operator/(const std::string& name) const { return (path / name).string(); }
    void write(const std::string& name, const std::string& text) const { std::ofstream(path / name) << text; }
};

/// What the fakes of a test share.
struct World {
    double sleep_per_sample = 0;  ///< seconds
    uint32_t batch = 3;
    int kill_at = -1;             ///< the render call that kills the process
    int stop_at = -1;             ///< the render call that raises *flag
    volatile bool flag = false;
    bool counters_restart = false;  ///< with the film
    int calls = 0, made = 0;
    uint64_t samples = 0;         ///< rendered by all
};

/// Every value is (1 + channel)·exponential; estimator naive has a bias of 10 %.
class FakeRenderer : public Renderer {
public:
    FakeRenderer(const Scene& scene, const RenderSettings& settings, World& world) : settings_(settings), world_(world) {
        ++world.made;
        film_.width = scene.sensor.crop_width;
        film_.height = scene.sensor.crop_height;
        clear_film();
    }
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        if (++world_.calls == world_.kill_at) ::raise(SIGKILL);
        uint32_t done = 0;
        for (; done < count; ++done) {
            if (world_.calls == world_.stop_at && done == 1) world_.flag = true;
            if (interrupt && *interrupt) break;
            if (world_.sleep_per_sample > 0) std::this_thread::sleep_for(std::chrono::duration<double>(world_.sleep_per_sample));
            for (uint32_t p = 0; p < film_.width * film_.height; ++p) {
                const Vec4f u = random_floats({settings_.seed, p, first + done, Stream::eye}, 0);
                const double v = -std::log(1.0 - double(u.x)) * (settings_.estimator == Estimator::naive ? 1.1 : 1.0);
                for (size_t c = 0; c < 3; ++c) {
                    film_.sum[3 * p + c] += v * double(1 + c);
                    film_.sum_squares[3 * p + c] += v * v * double(1 + c) * double(1 + c);
                }
            }
        }
        film_.samples += done;
        world_.samples += done;
        rays_ += uint64_t(done) * film_.width * film_.height;
        return done;
    }
    FilmMoments film() override { return film_; }
    void clear_film() override {
        film_.samples = 0;
        if (world_.counters_restart) rays_ = 0;
        film_.sum.assign(size_t(film_.width) * film_.height * 3, 0.0);
        film_.sum_squares = film_.sum;
    }
    RenderStats stats() override {
        RenderStats s;
        s.backend = "fake";
        s.device = "fake device";
        s.samples = film_.samples;
        s.rays_extend = rays_;
        return s;
    }
    uint32_t preferred_batch() const override { return world_.batch; }

private:
    RenderSettings settings_;
    World& world_;
    FilmMoments film_;
    uint64_t rays_ = 0;
};

Scene fake_scene(const std::string& path, const LoadOptions& options) {
    const std::string content = read_file(path);
    if (content.find("broken") != std::string::npos) throw input_error(path, 7, "unknown bsdf 'broken'");
    Scene scene;
    scene.path = path;
    scene.integrator.max_depth = 5;
    for (size_t i = 0; i < content.size(); ++i) scene.content_hash[i % 32] ^= uint8_t(content[i] + 31 * i);
    scene.sensor.crop_width = options.width ? options.width : 16;
    scene.sensor.crop_height = options.height ? options.height : 12;
    return scene;
}

Hooks fake_hooks(World& world) {
    return {fake_scene,
            [&world](const Scene& scene, const RenderSettings& settings) {
                if (settings.integrator != "path") throw Error(ExitCode::usage, "integrator '" + settings.integrator + "' is not known");
                return std::make_unique<FakeRenderer>(scene, settings, world);
            },
            [](RenderSettings& s, const std::string& key, const std::string& value) {
                if (key == "integrator")
                    s.integrator = value;
                else if (key == "max_depth")
                    s.max_depth = std::stoi(value);
                else if (key == "rr_depth")
                    s.rr_depth = std::stoi(value);
                else if (key == "estimator" && value == "naive")
                    s.estimator = Estimator::naive;
                else if (key == "estimator" && value == "mis")
                    s.estimator = Estimator::mis;
                else
                    throw Error(ExitCode::usage, key + "=" + value + " is not known");
            }};
}

constexpr const char* kConfig = R"(name = "fake"
seeds = [1, 2]
[reference]
spp = 400
[budget]
spp = [1, 2, 8, 32]
[[scene]]
name = "a"
path = "a.xml"
[[scene]]
name = "b"
path = "b.xml"
size = [9, 5]
[[run]]
name = "good"
integrator = "path"
[[run]]
name = "biased"
integrator = "path"
estimator = "naive"
)";

void write_inputs(const Folder& folder, const std::string& config = kConfig) {
    folder.write("a.xml", "<scene a>");
    folder.write("b.xml", "<scene b>");
    folder.write("e.toml", config);
}

ExperimentRequest request(const Folder& folder, const std::string& output, bool resume = false) {
    return {folder / "e.toml", folder / output, "", resume, nullptr};
}

std::vector<std::vector<std::string>> table(const std::string& path) {
    std::vector<std::vector<std::string>> rows;
    for (const std::string& line : read_results(path)) {
        std::istringstream in(line);
        rows.emplace_back();
        for (std::string field; std::getline(in, field, ',');) rows.back().push_back(field);
    }
    return rows;
}

size_t column(const std::string& name) {
    std::istringstream in(kResultHeader);
    size_t i = 0;
    for (std::string field; std::getline(in, field, ','); ++i)
        if (field == name) return i;
    FAIL("no column " << name);
    return 0;
}

/// Rows without the one column that clocks decide.
std::vector<std::vector<std::string>> timeless(const std::string& path) {
    auto rows = table(path);
    for (auto& row : rows) row[column("time")] = "";
    return rows;
}

std::string error_of(const std::function<void()>& f, ExitCode code = ExitCode::bad_input) {
    try {
        f();
    } catch (const Error& e) {
        CHECK(e.code == code);
        return e.what();
    }
    return "no error";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("G14: a time budget is met within 5 % of wall clock, whatever a sample costs") {
    for (const double cost : {0.0005, 0.004, 0.02}) {
        World world;
        world.sleep_per_sample = cost;
        world.batch = std::max(1u, uint32_t(0.2 / cost));
        const Scene scene = [] {
            Scene s;
            s.sensor.crop_width = s.sensor.crop_height = 2;
            return s;
        }();
        // A loaded machine may stop the process in the last batch: one of three tries must meet the budget.
        bool met = false;
        double wall = 0;
        for (int attempt = 0; attempt < 3 && !met; ++attempt) {
            FakeRenderer renderer(scene, {}, world);
            world.samples = 0;
            const auto start = std::chrono::steady_clock::now();
            const RenderPosition p = drive(renderer, {}, {0, 1.0});
            wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
            met = std::abs(wall - 1.0) <= 0.05;
            CHECK(p.samples == world.samples);
            CHECK(p.seconds <= wall);
        }
        CAPTURE(cost, wall);
        CHECK(met);
    }
}

TEST_CASE("sample budgets are exact and interruptions keep whole samples") {
    World world;
    Scene scene;
    scene.sensor.crop_width = scene.sensor.crop_height = 2;
    FakeRenderer renderer(scene, {}, world);
    CHECK(drive(renderer, {}, {10, 0}).samples == 10);
    CHECK(world.calls == 4);  // 3 3 3 1
    world.stop_at = 6;
    const RenderPosition p = drive(renderer, {10, 0, false}, {100, 0}, &world.flag);
    CHECK(p.interrupted);
    CHECK(p.samples == 14);  // 3, then 1 of 3
    CHECK(renderer.film().samples == 14);
    error_of([&] { drive(renderer, {}, {0, 0}); }, ExitCode::usage);
}

TEST_CASE("the reference: a killed and continued one equals the uninterrupted one") {
    const Folder folder;
    write_inputs(folder);
    World world;
    const Hooks hooks = fake_hooks(world);
    const Scene scene = fake_scene(folder / "a.xml", {});
    ReferenceRequest whole;
    whole.path = folder / "whole.exr";
    whole.spp = 64;
    const auto complete = make_reference(scene, whole, hooks);
    CHECK(complete.reference.samples == 64);

    ReferenceRequest part = whole;
    part.path = folder / "part.exr";
    part.checkpoint_seconds = 0;  // after every batch
    world.stop_at = world.calls + 5;
    part.interrupt = &world.flag;
    const auto stopped = make_reference(scene, part, hooks);
    CHECK(stopped.interrupted);
    const uint64_t kept = read_reference_exr(part.path).samples;
    CHECK(kept >= 2);
    CHECK(kept < 64);
    CHECK(kept == stopped.reference.samples);
    world.flag = false;
    world.sleep_per_sample = 0.001;  // so that checkpoints fall between batches
    const auto continued = make_reference(scene, part, hooks);
    CHECK(continued.continued_from == kept);
    CHECK(continued.reference.samples == 64);
    for (size_t i = 0; i < complete.reference.mean.rgb.size(); ++i) {
        REQUIRE(continued.reference.mean.rgb[i] == Approx(complete.reference.mean.rgb[i]).epsilon(1e-6));
        REQUIRE(continued.reference.standard_error.rgb[i] == Approx(complete.reference.standard_error.rgb[i]).epsilon(1e-5));
    }
    const uint64_t before = world.samples;
    CHECK(make_reference(scene, part, hooks).continued_from == 64);
    CHECK(world.samples == before);

    SECTION("what differs is named") {
        ReferenceRequest other = part;
        other.settings.max_depth = 3;
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }), "part.exr: cannot be continued: its max_depth is -1, asked for is 3"));
        other = part;
        other.settings.seed = 1ull << 40;
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }), "its seed is 0, asked for is 1099511627776"));
        Scene changed = scene;
        changed.content_hash[0] ^= 1;
        CHECK(contains(error_of([&] { make_reference(changed, part, hooks); }), "its scene_hash is"));
        changed = scene;
        changed.sensor.crop_width = 8;
        CHECK(contains(error_of([&] { make_reference(changed, part, hooks); }), "its size is 16x12, asked for is 8x12"));
        write_exr(folder / "image.exr", complete.reference.mean);
        other = part;
        other.path = folder / "image.exr";
        CHECK(contains(error_of([&] { make_reference(scene, other, hooks); }), "its kind is (not stated), asked for is reference"));
        other.path = folder / "none/r.exr";
        error_of([&] { make_reference(scene, other, hooks); }, ExitCode::device);
    }
    SECTION("seeds beyond 32 bits come back") {
        ReferenceRequest big = whole;
        big.path = folder / "big.exr";
        big.settings.seed = ~0ull;
        make_reference(scene, big, hooks);
        CHECK(make_reference(scene, big, hooks).continued_from == 64);
    }
}

TEST_CASE("a reference shares no random numbers with a render of the same seed") {
    const Folder folder;
    write_inputs(folder);
    World world;
    const Hooks hooks = fake_hooks(world);
    const Scene scene = fake_scene(folder / "a.xml", {});
    ReferenceRequest r;
    r.path = folder / "r.exr";
    r.spp = 64;
    const auto reference = make_reference(scene, r, hooks);
    FakeRenderer renderer(scene, {}, world);
    renderer.render(0, 64, nullptr);
    const Metrics m = compare_images(renderer.film(), reference.reference);
    // Independent: E (x-r)² is the sum of both variances; with shared samples it would be zero.
    CHECK(m.rmse_corrected == Approx(m.reference_noise).epsilon(0.25));
}

TEST_CASE("an experiment leaves what design.md describes") {
    const Folder folder;
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
    for (const char* file : {"config.resolved.toml", "manifest.json", "images/a/good_1.exr", "images/b/biased_2.png", "images/a/reference.png",
                             "stats/a/good_2.json"})
        CHECK(fs::exists(folder.path / "out" / file));
    CHECK_FALSE(fs::exists(folder.path / "out/state"));
    const auto manifest = nlohmann::json::parse(read_file(folder / "out/manifest.json"));
    CHECK(manifest["finished"].is_string());
    CHECK(manifest["devices"][0] == "fake device");
    CHECK(manifest["scenes"][1]["size"] == nlohmann::json({9, 5}));
    CHECK(fs::exists(folder.path / "out" / manifest["scenes"][0]["reference"]["file"].get<std::string>()));
    const auto stats = nlohmann::json::parse(read_file(folder / "out/stats/a/good_2.json"));
    CHECK(stats["spp"] == 32);
    CHECK(stats["rays"]["extend"] == 32 * 16 * 12);
    Attributes attributes;
    read_exr(folder / "out/images/a/good_2.exr", &attributes);
    CHECK(attributes["spp"] == 32);
    CHECK(attributes["seed"] == 2);

    // The error is that of the known process: sqrt(mean of variances/n), mean over channels of (1+c)² = 14/3; plus the bias of the biased one.
    double good = 0, biased = 0;
    for (const auto& row : rows)
        if (row[column("scene")] == "a" && row[column("spp")] == "32")
            (row[column("run")] == "good" ? good : biased) += std::pow(std::stod(row[column("rmse_corrected")]), 2) / 2;
    CHECK(good == Approx(14.0 / 3 / 32).epsilon(0.3));
    CHECK(biased == Approx(14.0 / 3 * (1.21 / 32 + 0.01)).epsilon(0.3));

    SECTION("the folder is not overwritten, and nothing is left to do for --resume") {
        CHECK(contains(error_of([&] { run_experiment(request(folder, "out"), fake_hooks(world)); }, ExitCode::usage), "--resume"));
        const std::string before = read_file(folder / "out/runs.csv");
        const uint64_t samples = world.samples;
        CHECK(run_experiment(request(folder, "out", true), fake_hooks(world)) == ExitCode::done);
        CHECK(world.samples == samples);
        CHECK(read_file(folder / "out/runs.csv") == before);
    }
    SECTION("a changed configuration or scene is refused by name") {
        folder.write("e.toml", std::string(kConfig).replace(std::string(kConfig).find("[1, 2]"), 6, "[1, 3]"));
        CHECK(contains(error_of([&] { run_experiment(request(folder, "out", true), fake_hooks(world)); }), "'seeds = [ 1, 2 ]' there, 'seeds = [ 1, 3 ]' now"));
        write_inputs(folder);
        folder.write("b.xml", "<scene changed>");
        CHECK(contains(error_of([&] { run_experiment(request(folder, "out", true), fake_hooks(world)); }), "b.xml: has changed"));
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
    const Folder folder;
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
            CHECK(bool(read_exr(folder / (out + "/" + image)).rgb == read_exr(folder / ("whole/" + std::string(image))).rgb));
    }
}

TEST_CASE("a signal ends an experiment with what is done saved, and resuming repeats no sample") {
    const Folder folder;
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

TEST_CASE("a damaged state costs the render, not the experiment") {
    const Folder folder;
    RenderState state{{1, 1, 2, {1, 2, 3}, {4, 5, 6}}, {{"rows", {"x"}}}};
    write_state(folder / "s", state);
    const auto back = read_state(folder / "s");
    REQUIRE(back);
    CHECK(back->moments.sum == state.moments.sum);
    CHECK(back->moments.sum_squares == state.moments.sum_squares);
    CHECK(back->notes == state.notes);
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
    const Folder folder;
    std::string config = kConfig;
    config.replace(config.find("spp = [1, 2, 8, 32]"), 19, "seconds = [0.1, 0.3]");
    config.replace(config.find("seeds = [1, 2]"), 14, "seeds = [7]");
    write_inputs(folder, config);
    World world;
    world.sleep_per_sample = 0.0002;
    world.batch = 50;
    CHECK(run_experiment(request(folder, "out"), fake_hooks(world)) == ExitCode::done);
    const auto rows = table(folder / "out/runs.csv");
    REQUIRE(rows.size() == 2 * 2 * 2);
    int met = 0;  // a loaded machine delays some
    for (size_t i = 0; i < rows.size(); ++i) {
        const double budget = i % 2 ? 0.3 : 0.1, time = std::stod(rows[i][column("time")]);
        CHECK(time > 0.95 * budget);
        met += time < 1.05 * budget;
    }
    CHECK(met >= 5);
}

TEST_CASE("two processes do not share a folder; a folder that cannot be made is a device error") {
    const Folder folder;
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
            message = error_of([&] { run_experiment(request(folder, "out", true), fake_hooks(*inner_world)); }, ExitCode::device);
        }
        return make(s, settings);
    };
    run_experiment(request(folder, "out"), hooks);
    CHECK(contains(message, "another experiment is writing into"));
    folder.write("file", "");
    CHECK(contains(error_of([&] { run_experiment(request(folder, "file/out"), fake_hooks(world)); }, ExitCode::device), "file/out"));
}

TEST_CASE("configurations are refused with file, line and the offending name, before anything is rendered") {
    const Folder folder;
    const auto refused = [&](const std::string& from, const std::string& to) {
        std::string config = kConfig;
        const size_t at = config.find(from);
        REQUIRE(at != std::string::npos);
        write_inputs(folder, config.replace(at, from.size(), to));
        folder.write("broken.xml", "broken");
        World world;
        const std::string message = error_of([&] { run_experiment(request(folder, "out"), fake_hooks(world)); });
        CHECK(world.calls == 0);
        CHECK_FALSE(fs::exists(folder.path / "out"));
        return message;
    };
    CHECK(contains(refused("seeds = [1, 2]", "seed = [1, 2]"), "e.toml:2: unknown key 'seed' in the configuration; known are: name"));
    CHECK(contains(refused("seeds = [1, 2]", "seeds = [1, 1]"), "e.toml:2: seed 1 is listed twice"));
    CHECK(contains(refused("seeds = [1, 2]", "seeds = 1"), "e.toml:2: 'seeds' must be a list"));
    CHECK(contains(refused("seeds = [1, 2]", "seeds = [1, 2"), "e.toml:3: "));
    CHECK(contains(refused("seeds = [1, 2]\n", ""), "e.toml: lacks the key 'seeds'"));
    CHECK(contains(refused("spp = 400", "spp = 1"), "e.toml:4: 'spp' must be an integer from 2"));
    CHECK(contains(refused("spp = [1, 2, 8, 32]", "spp = [1, 2, 2]"), "e.toml:6: 'spp' must rise; 2 does not"));
    CHECK(contains(refused("spp = [1, 2, 8, 32]", "seconds = [-1.0]"), "e.toml:6: 'seconds' must be positive"));
    CHECK(contains(refused("spp = [1, 2, 8, 32]", ""), "e.toml:5: [budget] needs 'spp', 'seconds' or both"));
    CHECK(contains(refused("path = \"b.xml\"", "path = \"c.xml\""), "e.toml:12: scene 'b': there is no file "));
    CHECK(contains(refused("path = \"b.xml\"", "path = \"broken.xml\""), "broken.xml:7: unknown bsdf 'broken'"));
    CHECK(contains(refused("size = [9, 5]", "size = [9]"), "e.toml:13: 'size' must be [width, height]"));
    CHECK(contains(refused("size = [9, 5]", "sise = [9, 5]"), "e.toml:13: unknown key 'sise' in [[scene]]"));
    CHECK(contains(refused("name = \"biased\"", "name = \"good\""), "e.toml:18: name 'good' of [[run]] is used twice"));
    CHECK(contains(refused("name = \"biased\"", "name = \"a/b\""), "e.toml:18: name 'a/b'"));
    CHECK(contains(refused("estimator = \"naive\"", "estimator = \"best\""), "e.toml:20: run 'biased': estimator=best is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "set = { rr_dept = 3 }"), "e.toml:20: run 'biased': rr_dept=3 is not known"));
    CHECK(contains(refused("estimator = \"naive\"", "set = { seed = 3 }"), "e.toml:20: 'seed' belongs to the experiment"));
    CHECK(contains(refused("estimator = \"naive\"", "integrator2 = 1"), "e.toml:20: unknown key 'integrator2' in [[run]]"));
    CHECK(contains(refused("name = \"biased\"\nintegrator = \"path\"", "name = \"biased\"\nintegrator = \"magic\""),
                   "e.toml:17: run 'biased' on scene 'a': integrator 'magic' is not known"));
    World world;
    ExperimentRequest missing{folder / "none.toml", folder / "out", "", false, nullptr};
    CHECK(contains(error_of([&] { run_experiment(missing, fake_hooks(world)); }), "none.toml: No such file"));
}
