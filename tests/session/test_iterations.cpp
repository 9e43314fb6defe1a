// libs: ambilux_experiments
// timeout: 120
// Renders of whole iterations, and methods whose devices keep a state: what is stopped goes on as if it had not been.
#include "core/flag.h"
#include "core/log.h"
#include "film/exr_io.h"
#include "integrators/setting.h"
#include "render/chosen.h"
#include "render/invalid_watch.h"
#include "render/sample_watch.h"
#include "session/parallel/checkpoint.h"
#include "session/parallel/parallel_render.h"
#include "session/parallel/state_log.h"
#include "session/reference.h"
#include "session/state.h"
#include "tests/support/experiment_fakes.h"
#include "tests/support/render_scene.h"
#include "tests/support/thread_ranks.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// Iterations of four samples, and a state.
struct ByFour : FakeRenderer {
    using FakeRenderer::FakeRenderer;
    std::vector<std::byte> state = {std::byte{7}};
    std::vector<uint32_t> counts;
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        CHECK(first % 4 == 0);
        CHECK(count % 4 == 0);
        counts.push_back(count);
        uint32_t done = 0;
        while (done < count && !is_set(interrupt)) done += FakeRenderer::render(first + done, 4, nullptr);
        return done;
    }
    uint32_t iteration_samples() const override { return 4; }
    StateKind state_kind() const override { return StateKind::per_device; }
    std::vector<std::byte> save_state() override { return state; }
    void load_state(std::span<const std::byte> saved) override { state.assign(saved.begin(), saved.end()); }
};

/// Says what it costs.
struct TimedByFour : ByFour, SelfTimed {
    double last = 0;
    using ByFour::ByFour;
    uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
        const uint32_t done = ByFour::render(first, count, interrupt);
        last = 0.1 * done;
        return done;
    }
    double last_seconds() const override { return last; }
};

Scene small_scene() {
    Scene scene;
    scene.sensor.crop_width = scene.sensor.crop_height = 2;
    return scene;
}

RenderSettings learned(const Scene& scene) {
    RenderSettings settings = cpu_settings(scene, Estimator::mis);
    apply_setting(settings, "integrator", "bdpt");
    apply_setting(settings, "variant", "learned");
    return settings;
}

ParallelRequest learned_request(const Scene& scene, const TempFolder& folder, size_t workers, bool resume) {
    ParallelRequest request;
    request.settings = learned(scene);
    request.budget = {50, 0};
    request.devices = std::vector<std::string>(workers, "cpu");
    request.range_size = 3;
    request.state_path = folder / "state";
    request.resume = resume;
    return request;
}

/// Stopped after some ranges.
ParallelResult stopped(ParallelRequest request, const std::function<ParallelResult(const ParallelRequest&)>& render) {
    volatile bool interrupt = false;
    request.interrupt = &interrupt;
    request.on_progress = [&](const RenderPosition& p, const RenderStats&) {
        if (p.samples > 10) set_flag(&interrupt);
    };
    return render(request);
}

bool same(const FilmMoments& a, const FilmMoments& b) {
    return a.width == b.width && a.height == b.height && a.samples == b.samples && a.sum == b.sum &&
           a.sum_squares == b.sum_squares;
}

FilmMoments pixel() { return {1, 1, 1, std::vector<double>(3), std::vector<double>(3)}; }

}  // namespace

TEST_CASE("a number of samples that is no whole iterations is refused before any is rendered") {
    World world;
    ByFour renderer(small_scene(), {}, world);
    const std::string message = error_of([&] { drive(renderer, {}, {10, 0}); }, ExitCode::usage);
    CHECK(contains(message, "spp=10: "));
    CHECK(contains(message, "iterations of 4 samples: 8 or 12"));
    CHECK(contains(error_of([&] { drive(renderer, {}, {3, 5}); }, ExitCode::usage), "4 samples: 4 would be"));
    CHECK(world.samples == 0);
    CHECK(contains(error_of([] { check_iterations("range-size", 6, 4, {}); }, ExitCode::usage), "range-size=6: "));
}

TEST_CASE("batches are whole iterations, by samples and by time, and so is what an interrupt leaves") {
    World world;
    const Scene scene = small_scene();
    ByFour renderer(scene, {}, world);
    world.batch = 3;
    CHECK(drive(renderer, {}, {8, 0}).samples == 8);
    CHECK(renderer.counts == std::vector<uint32_t>{4, 4});
    world.batch = 11;
    CHECK(drive(renderer, {8, 0, false}, {20, 0}).samples == 20);
    CHECK(renderer.counts == std::vector<uint32_t>{4, 4, 8, 4});
    world.stop_at = world.calls + 2;
    const RenderPosition p = drive(renderer, {20, 0, false}, {100, 0}, &world.flag);
    CHECK(p.interrupted);
    CHECK(p.samples == 28);

    // The last samples that have numbers are 3 too few for an iteration.
    world.batch = 1000;
    renderer.counts.clear();
    constexpr uint64_t kWhole = 4294967292;
    CHECK(drive(renderer, {kWhole - 12, 0.001, false, 1e-6, 1000}, {0, 1e9}).samples == kWhole);
    CHECK(renderer.counts == std::vector<uint32_t>{12});

    // An iteration takes 0.4 s.
    for (const auto& [seconds, samples] : std::vector<std::pair<double, uint64_t>>{{0.01, 4}, {0.9, 8}, {1.1, 12}}) {
        CAPTURE(seconds);
        TimedByFour timed(scene, {}, world);
        const RenderPosition end = drive(timed, {}, {0, seconds});
        CHECK(end.samples == samples);
        CHECK(end.per_iteration() == Approx(0.4));
        CHECK(drive(timed, end, {0, end.seconds + 0.19}).samples == samples);  // no time for half of one
        CHECK(drive(timed, end, {0, end.seconds + 0.21}).samples == samples + 4);
    }
}

TEST_CASE("experiments and references render whole iterations, and refuse checkpoints that are none") {
    const TempFolder folder;
    World world;
    Hooks hooks = fake_hooks(world);
    hooks.make_renderer = [&](const Scene& scene, const RenderSettings& settings) {
        return std::make_unique<ByFour>(scene, settings, world);
    };
    write_inputs(folder);
    CHECK(contains(error_of([&] { run_experiment(request(folder, "out"), hooks); }), "spp=1: "));
    CHECK(world.samples == 0);
    std::string config = kConfig;
    config.replace(config.find("[1, 2, 8, 32]"), 13, "[4, 16, 36]");
    write_inputs(folder, config);
    CHECK(run_experiment(request(folder, "out"), hooks) == ExitCode::done);
    CHECK(world.samples == 2 * 400 + 8 * 36);
}

TEST_CASE("wrapped renderers have the iterations and the state of what they wrap") {
    World world;
    const auto check = [&](const auto& wrap) {
        auto inner = std::make_unique<ByFour>(small_scene(), RenderSettings{}, world);
        ByFour& own = *inner;
        const std::unique_ptr<Renderer> renderer = wrap(std::move(inner));
        CHECK(renderer->iteration_samples() == 4);
        CHECK(renderer->state_kind() == StateKind::per_device);
        CHECK(renderer->save_state() == own.state);
        const std::vector<std::byte> other(3);
        renderer->load_state(other);
        CHECK(own.state == other);
    };
    check([](std::unique_ptr<Renderer> r) { return std::make_unique<Chosen>(std::move(r), 0, SelectionStats{}); });
    check([](std::unique_ptr<Renderer> r) { return std::make_unique<InvalidWatch>(std::move(r)); });
    check([](std::unique_ptr<Renderer> r) { return std::make_unique<SampleWatch>(std::move(r)); });
}

TEST_CASE("samples that are ready begin a render from the first one on, and whatever else is asked for drops them") {
    World world;
    const Scene scene = small_scene();
    const auto made = [&](uint32_t ready) {
        auto inner = std::make_unique<FakeRenderer>(scene, RenderSettings{}, world);
        inner->render(0, ready, nullptr);
        SelectionStats selection;
        selection.name = "path";
        return std::make_unique<Chosen>(std::move(inner), ready, selection);
    };
    const auto plain = [&](uint32_t first, uint32_t count) {
        FakeRenderer renderer(scene, {}, world);
        renderer.render(first, count, nullptr);
        return renderer.film();
    };
    for (const uint32_t ready : {0u, 1u, 5u}) {
        CAPTURE(ready);
        for (const uint32_t count : {ready, ready + 2}) {
            const auto r = made(ready);
            CHECK(r->ready() == ready);
            CHECK(r->stats().selection.name == "path");
            const uint64_t before = world.samples;
            CHECK(r->render(0, count, nullptr) == count);
            CHECK(world.samples - before == count - ready);
            CHECK(r->ready() == 0);
            CHECK(r->render(count, 3, nullptr) == 3);
            CHECK(same(r->film(), plain(0, count + 3)));
        }
        const auto of_others = made(ready);
        CHECK(of_others->render(2, 6, nullptr) == 6);
        REQUIRE(same(of_others->film(), plain(2, 6)));
        if (ready > 0) {
            const auto of_fewer = made(ready);
            CHECK(of_fewer->render(0, ready - 1, nullptr) == ready - 1);
            CHECK(same(of_fewer->film(), plain(0, ready - 1)));
        }
        const std::vector<std::function<void(Chosen&)>> asked = {
            [](Chosen& r) { CHECK(r.film().samples == 0); }, [](Chosen& r) { CHECK(r.take_film()().samples == 0); },
            [](Chosen& r) { r.clear_film(); }, [](Chosen& r) { CHECK_FALSE(r.device_image().has_value()); },
            [](Chosen& r) { r.load_state({}); }};
        for (const auto& ask : asked) {
            const auto r = made(ready);
            ask(*r);
            CHECK(r->ready() == 0);
            CHECK(r->render(0, 4, nullptr) == 4);
            CHECK(same(r->film(), plain(0, 4)));
        }
    }
}

TEST_CASE("batches that drop values are remembered, and their first bad iterations are found by rendering them again") {
    World world;
    struct Dropping : FakeRenderer {
        using FakeRenderer::FakeRenderer;
        uint32_t k = 1;
        std::vector<uint32_t> firsts;
        std::map<std::string, InvalidCounts> dropped;
        uint32_t render(uint32_t first, uint32_t count, const volatile bool* interrupt) override {
            firsts.push_back(first);
            for (uint32_t sample = first; sample < first + count; ++sample) {
                if (sample % 3 == 2) dropped["shade"].nan += 1, dropped["shade"].underflow += 1;
                if (sample % 8 == 3) dropped["splat"].inf += 2, dropped["splat"].negative += 5;
            }
            dropped["occlude"].underflow += count;  // no error by itself
            return FakeRenderer::render(first, count, interrupt);
        }
        RenderStats stats() override {
            RenderStats s = FakeRenderer::stats();
            s.invalid_by_stage = dropped;
            return s;
        }
        uint32_t iteration_samples() const override { return k; }
    };
    const auto make = [&](uint32_t k) {
        auto renderer = std::make_unique<Dropping>(small_scene(), RenderSettings{}, world);
        renderer->k = k;
        return renderer;
    };
    auto owned = make(1);
    Dropping& renderer = *owned;
    InvalidWatch watch(std::move(owned));
    CHECK(watch.render(0, 2) == 2);
    CHECK(watch.batches().empty());
    CHECK(watch.render(2, 8) == 8);
    CHECK(watch.render(12, 2) == 2);
    REQUIRE(watch.batches().size() == 1);
    const InvalidBatch batch = watch.batches()[0];
    CHECK(batch.first == 2);
    CHECK(batch.count == 8);
    REQUIRE(batch.by_stage.size() == 2);
    CHECK(batch.by_stage.at("shade").nan == 3);  // 2, 5 and 8
    CHECK(batch.by_stage.at("shade").total() == 3);
    CHECK(batch.by_stage.at("splat").inf == 2);
    CHECK(batch.by_stage.at("splat").negative == 5);
    CHECK(watch.by_stage().at("occlude").underflow == 12);

    const auto found = [&](InvalidWatch& of, const InvalidBatch& in, size_t most, const volatile bool* stop = nullptr) {
        std::vector<uint32_t> firsts;
        for (const InvalidBatch& b : of.samples(in, most, stop)) firsts.push_back(b.first);
        return firsts;
    };
    renderer.firsts.clear();
    CHECK(found(watch, batch, 2) == std::vector<uint32_t>{2, 3});
    CHECK(renderer.firsts == std::vector<uint32_t>{2, 3});  // no more than were asked for
    renderer.firsts.clear();
    CHECK(found(watch, batch, 100) == std::vector<uint32_t>{2, 3, 5, 8});
    CHECK(renderer.firsts == std::vector<uint32_t>{2, 3, 4, 5, 6, 7, 8, 9});
    for (const InvalidBatch& one : watch.samples(batch, 100, nullptr)) CHECK(one.count == 1);
    CHECK(watch.samples({3, 1, {}}, 100, nullptr).size() == 1);  // by itself
    const volatile bool stop = true;
    CHECK(found(watch, batch, 100, &stop).empty());
    InvalidWatch by_four(make(4));
    CHECK(found(by_four, {4, 12, {}}, 100) == std::vector<uint32_t>{4, 8, 12});
    CHECK(found(by_four, {4, 12, {}}, 0).empty());

    for (uint32_t i = 0; i < 12; ++i) watch.render(2, 1);
    CHECK(watch.batches().size() == InvalidWatch::kMostBatches);
}

TEST_CASE("a saved state comes back whole, and one that is damaged anywhere is none") {
    const TempFolder folder;
    const std::string path = folder / "state";
    const auto bytes = [](std::initializer_list<int> values) {
        std::vector<std::byte> all;
        for (const int v : values) all.push_back(std::byte(v));
        return all;
    };
    const RenderState state = {
        {2, 1, 5, {1, 2, 3, 4, 5, 6}, {7, 8, 9, 10, 11, 12}}, {{"seconds", 0.5}}, {bytes({1, 2, 3}), {}, bytes({4})}};
    write_state(path, state);
    const std::string good = read_file(path);
    const RenderState back = read_state(path).value();
    CHECK(back.moments.width == 2);
    CHECK(back.moments.height == 1);
    CHECK(same(back.moments, state.moments));
    CHECK(back.notes == state.notes);
    CHECK(back.devices == state.devices);
    CHECK_FALSE(read_state(folder / "none").has_value());

    // By what takes the place of the checksum alone, and with one that fits.
    constexpr size_t kHash = 8, kMagic = 16;
    const auto with_checksum = [](std::string content) {
        uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
        for (const char c : content) hash = (hash ^ uint8_t(c)) * 0x100000001b3ull;
        return content.append(reinterpret_cast<const char*>(&hash), sizeof hash);
    };
    const std::string body = good.substr(0, good.size() - kHash);
    REQUIRE(with_checksum(body) == good);
    const auto is_damaged = [&](const std::string& content) {
        folder.write("state", content);
        const bool quiet = is_quiet();
        set_quiet(true);
        const bool damaged = !read_state(path).has_value();
        set_quiet(quiet);
        return damaged;
    };
    for (size_t length = 0; length < good.size(); ++length) CHECK(is_damaged(good.substr(0, length)));
    for (size_t length = 0; length < body.size(); ++length) CHECK(is_damaged(with_checksum(body.substr(0, length))));
    CHECK(is_damaged(with_checksum(body + '\0')));
    for (size_t at = 0; at < good.size(); ++at) {
        std::string changed = good;
        changed[at] ^= 1;
        CHECK(is_damaged(changed));
    }
    // Sizes: of the notes, of the film, of all values, of the devices, of the state of the first device.
    const size_t notes = state.notes.dump().size(), devices = kMagic + 48 + notes + 2 * 6 * 8;
    for (const size_t at : {kMagic, kMagic + 8, kMagic + 16, kMagic + 32, kMagic + 40, devices})
        for (const uint64_t size : {uint64_t(1) << 20, ~uint64_t(0)}) {
            CAPTURE(at, size);
            std::string changed = body;
            changed.replace(at, 8, reinterpret_cast<const char*>(&size), 8);
            CHECK(is_damaged(with_checksum(changed)));
        }
    // More values than there can be, as many as the film says.
    std::string large = body;
    const uint64_t sides[] = {uint64_t(1) << 30, uint64_t(1) << 31}, values = 3 * sides[0] * sides[1];
    large.replace(kMagic + 8, 16, reinterpret_cast<const char*>(sides), 16);
    large.replace(kMagic + 32, 8, reinterpret_cast<const char*>(&values), 8);
    CHECK(is_damaged(with_checksum(large)));
    std::string no_json = body;
    no_json[kMagic + 48] = 'x';
    CHECK(is_damaged(with_checksum(no_json)));
    CHECK_FALSE(is_damaged(good));
}

TEST_CASE("the sums of a tree are saved one by one, with notes and states, and a render of something else is refused") {
    const TempFolder folder;
    CheckpointFile file(folder / "state");
    MergeTree tree, read;
    DeviceStates devices;
    CHECK_FALSE(file.exists());
    CHECK(file.read(read, devices).is_null());
    const auto film = [](uint64_t samples, double first) {
        return FilmMoments{1, 2, samples, {first, 2, 3, 4, 5, 6}, {7, 8, 9, 10, 11, 12 * first}};
    };
    tree.add({1, 0}, film(6, 1));
    tree.add({0, 3}, film(3, 20));
    tree.add({2, 2}, film(12, 300));
    const nlohmann::json identity = {{"scene_hash", "ab"}, {"spp", 100}, {"settings", {{"seed", 1}, {"depth", 4}}}};
    const DeviceStates kept = {{std::byte{1}}, {}};
    file.write(tree, {{"identity", identity}, {"range_size", 3}, {"seconds", 0.5}}, kept);
    file.wait();
    CHECK(file.exists());
    const nlohmann::json notes = file.read(read, devices);
    CHECK(notes.at("seconds") == 0.5);
    CHECK(devices == kept);
    CHECK(read.samples() == 21);
    const std::optional<RenderState> state = read_state(folder / "state");
    REQUIRE(state.has_value());
    CHECK(state->moments.width == 1);
    CHECK(state->moments.height == 3 * 2);
    CHECK(state->moments.samples == 6 + 3 + 12);
    CHECK(state->notes.at("nodes") == nlohmann::json({{1, 0, 6}, {0, 3, 3}, {2, 2, 12}}));
    REQUIRE(read.entries().size() == 3);
    for (const auto& [first, entry] : tree.entries()) {
        const MergeTree::Entry& back = read.entries().at(first);
        CHECK(back.node == entry.node);
        CHECK(same(back.film, entry.film));
    }
    CHECK_NOTHROW(file.check_same(notes, identity, 3));
    CHECK_NOTHROW(file.check_same(notes, identity, 0));
    const auto refused = [&](const nlohmann::json& other, uint32_t size) {
        const std::string text = error_of([&] { file.check_same(notes, other, size); }), from = "its ";
        return text.substr(text.find(from) + from.size(), text.find(" differs") - text.find(from) - from.size());
    };
    CHECK(refused(identity, 4) == "range size");
    for (const char* key : {"scene_hash", "spp"}) {
        nlohmann::json other = identity;
        other[key] = "other";
        CHECK(refused(other, 3) == key);
    }
    for (const char* key : {"seed", "new"}) {
        nlohmann::json other = identity;
        other["settings"][key] = 2;
        CHECK(refused(other, 3) == key);
    }
    file.write({}, {{"identity", identity}}, {});
    file.wait();
    CHECK(file.read(read, devices).at("nodes").empty());
    CHECK(read.entries().empty());
    file.remove();
    CHECK_FALSE(file.exists());
}

TEST_CASE("states that are saved have learned from films that are there alone") {
    const auto state = [](size_t device, uint64_t range) {
        return RangeState{device, range, std::vector<std::byte>(size_t(range + 1))};
    };
    const auto sizes = [](const DeviceStates& states) {
        std::vector<size_t> all;
        for (const auto& s : states) all.push_back(s.size());
        return all;
    };
    StateLog log(DeviceStates(3));
    log.add(0, {state(0, 0), state(0, 2)});
    log.add(1, {state(0, 1), state(1, 3), state(0, 4)});
    MergeTree films;
    CHECK(sizes(log.saved(films)) == std::vector<size_t>{0, 0, 0});
    films.add({0, 2}, pixel());  // range 0 of its device is missing
    CHECK(sizes(log.saved(films)) == std::vector<size_t>{0, 0, 0});
    films.add({0, 0}, pixel());
    films.add({0, 1}, pixel());
    CHECK(sizes(log.saved(films)) == std::vector<size_t>{3, 2, 0});
    films.add({0, 3}, pixel());
    films.add({0, 4}, pixel());
    CHECK(sizes(log.saved(films)) == std::vector<size_t>{3, 5, 4});
}

TEST_CASE("learned, stopped and resumed on the device that it had, has the bits of an uninterrupted render") {
    const Scene scene = project_scene("cornell", 24, 18);
    const TempFolder folder;
    const auto render = [&](const ParallelRequest& r) { return render_parallel(scene, r, ranks()); };
    const FilmMoments expected = render(learned_request(scene, folder, 1, false)).film;
    const ParallelResult part = stopped(learned_request(scene, folder, 1, false), render);
    REQUIRE(part.position.interrupted);
    REQUIRE(part.film.samples < 50);
    const std::string saved = read_file(folder / "state");

    const std::string refused = error_of([&] { render(learned_request(scene, folder, 2, true)); });
    CHECK(contains(refused, "1 device saved"));
    CHECK(contains(refused, "2 devices would go on"));
    CHECK(read_file(folder / "state") == saved);
    CHECK(same(render(learned_request(scene, folder, 1, true)).film, expected));
    CHECK_FALSE(fs::exists(folder / "state"));

    // Without what was learned it would be another image: nothing above is true by chance.
    folder.write("state", saved);
    RenderState state = read_state(folder / "state").value();
    REQUIRE(state.devices.size() == 1);
    state.devices[0].resize(state.devices[0].size() / 2);
    write_state(folder / "state", state);
    CHECK(contains(error_of([&] { render(learned_request(scene, folder, 1, true)); }), "saved state: "));
    state.devices[0].clear();
    write_state(folder / "state", state);
    CHECK_FALSE(same(render(learned_request(scene, folder, 1, true)).film, expected));
    folder.write("state", saved);
    state.devices.clear();
    write_state(folder / "state", state);
    CHECK(contains(error_of([&] { render(learned_request(scene, folder, 1, true)); }), "0 devices saved"));
}

TEST_CASE("several devices and ranks save what each has learned, and as many go on") {
    const Scene scene = project_scene("cornell", 24, 18);
    for (const int count : {1, 2, 3}) {
        CAPTURE(count);
        const TempFolder folder;
        const auto render = [&](const ParallelRequest& request) {
            ThreadRanks all(count);
            ParallelResult result;
            all.run([&](Ranks& r) {
                if (r.rank() == 0)
                    result = render_parallel(scene, request, r);
                else
                    serve_parallel(scene, request, r);
            });
            return result;
        };
        // The ranks of a host share its devices: two for one rank, one each for two or three.
        const ParallelResult part = stopped(learned_request(scene, folder, 2, false), render);
        REQUIRE(part.position.interrupted);
        REQUIRE(read_state(folder / "state").value().devices.size() == part.workers.size());
        const ParallelResult whole = render(learned_request(scene, folder, 2, true));
        CHECK(whole.film.samples == 50);
        CHECK(whole.stats.invalid.total() == 0);
        CHECK(whole.workers.size() == part.workers.size());
    }
}

TEST_CASE("a learned reference that was stopped goes on with what it had learned") {
    const Scene scene = project_scene("cornell", 24, 18);
    const TempFolder folder;
    const auto request_for = [&](const std::string& name) {
        ReferenceRequest r = reference_request(folder / name, 64, learned(scene));
        r.checkpoint_seconds = 1e-3;
        return r;
    };
    const Image expected = make_reference(scene, request_for("whole.exr"), default_hooks()).reference.mean;
    volatile bool interrupt = false;
    ReferenceRequest r = request_for("part.exr");
    r.interrupt = &interrupt;
    r.on_batch = [&](const RenderPosition& p) {
        if (p.samples >= 12) set_flag(&interrupt);
    };
    const ReferenceResult part = make_reference(scene, r, default_hooks());
    REQUIRE(part.interrupted);
    REQUIRE(part.reference.samples < 64);
    const ReferenceResult whole = make_reference(scene, request_for("part.exr"), default_hooks());
    CHECK(whole.continued_from == part.reference.samples);
    // Films of checkpoints, whose bounds the clock sets, are added up.
    double most = 0;
    for (size_t i = 0; i < expected.rgb.size(); ++i)
        most = std::max(most, std::abs(double(whole.reference.mean.rgb[i]) / expected.rgb[i] - 1));
    CHECK(most < 1e-6);
}

TEST_CASE("an experiment with learned, stopped and resumed, has the image of an uninterrupted one") {
    const TempFolder folder;
    folder.write("e.toml", std::string(R"(name = "kept"
repeats = 0
backend = "cpu"
seeds = [1]
[reference]
spp = 16
[budget]
spp = [4, 32]
[[scene]]
name = "cornell"
path = ")") + AMBILUX_SOURCE_DIR +
                               R"(/scenes/cornell.xml"
size = [24, 18]
[[run]]
name = "learned"
integrator = "bdpt"
variant = "learned"
)");
    const auto image = [&](const std::string& out) {
        return read_exr(folder / (out + "/images/cornell/learned_1.exr")).rgb;
    };
    REQUIRE(run_experiment(request(folder, "whole"), default_hooks()) == ExitCode::done);
    volatile bool interrupt = false;
    Hooks hooks = default_hooks();
    int readings = 0;
    hooks.load = [&] {
        if (++readings == 9) set_flag(&interrupt);  // two for each batch
        return LoadReading{};
    };
    ExperimentRequest r = request(folder, "part");
    r.interrupt = &interrupt;
    REQUIRE(run_experiment(r, hooks) == ExitCode::interrupted);
    REQUIRE(fs::exists(folder / "part/state/cornell"));
    REQUIRE(run_experiment(request(folder, "part", true), default_hooks()) == ExitCode::done);
    CHECK(bool(image("part") == image("whole")));
}
