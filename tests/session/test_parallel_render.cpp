// libs: ambilux_session
// timeout: 120
// Several workers in one process: the image of a render does not depend on how many there are, nor on interrupts.
#include <atomic>
#include <chrono>
#include <thread>

#include "accel/embree_tracer.h"
#include "core/error.h"
#include "core/flag.h"
#include "film/ztest.h"
#include "session/parallel/parallel_render.h"
#include "session/state.h"
#include "session/statistics.h"
#include "session/stats_sum.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

ParallelRequest request_for(const Scene& scene, const test::TempFolder& folder, const std::string& integrator,
                            const std::string& variant, size_t workers) {
    ParallelRequest request;
    request.settings = cpu_settings(scene, Estimator::mis);
    apply_setting(request.settings, "integrator", integrator);
    apply_setting(request.settings, "variant", variant);
    request.budget = {50, 0};
    request.devices = std::vector<std::string>(workers, "cpu");
    request.range_size = 3;
    request.state_path = folder / "state";
    return request;
}

bool same(const FilmMoments& a, const FilmMoments& b) {
    return a.width == b.width && a.height == b.height && a.samples == b.samples && a.sum == b.sum &&
           a.sum_squares == b.sum_squares;
}

}  // namespace

TEST_CASE("sums and second moments have the same bits for 1, 2 and 3 workers") {
    const Scene scene = project_scene("glass", 40, 30);
    const test::TempFolder folder;
    for (const auto& [integrator, variant] : std::vector<std::pair<std::string, std::string>>{{"path", "wavefront"},
                                                                                              {"light", "wavefront"},
                                                                                              {"bdpt", "wavefront"},
                                                                                              {"bdpt", "streaming"},
                                                                                              {"bdpt", "lvc"}}) {
        CAPTURE(integrator, variant);
        std::optional<ParallelResult> first;
        for (const size_t workers : {1, 2, 3}) {
            const ParallelResult result =
                render_parallel(scene, request_for(scene, folder, integrator, variant, workers), ranks());
            CHECK(result.film.samples == 50);
            CHECK(result.stats.samples == 50);
            CHECK(result.workers.size() == workers);
            if (!first) first = result;
            CHECK(same(result.film, first->film));
            CHECK(result.stats.rays_extend == first->stats.rays_extend);
        }
        CHECK(!std::filesystem::exists(folder / "state"));
    }
}

TEST_CASE("a render by ranges is the estimate of a plain one, lvc with a cache per worker included") {
    const Scene scene = project_scene("cornell", 32, 24);
    const test::TempFolder folder;
    for (const std::string variant : {"wavefront", "lvc"}) {
        CAPTURE(variant);
        ParallelRequest request = request_for(scene, folder, "bdpt", variant, 2);
        request.budget.samples = 400;
        request.range_size = 16;
        request.settings.seed = 7;
        const ParallelResult parts = render_parallel(scene, request, ranks());
        request.settings.seed = 8;
        const RenderResult plain = render_scene(scene, request.settings, 400);
        const ZTestResult z = z_test(to_estimate(parts.film), to_estimate(plain.film), {});
        INFO(z.report());
        CHECK(z.pass);
    }
}

TEST_CASE("interrupted and resumed with other workers: the same bits, and the state is gone") {
    const Scene scene = project_scene("cornell", 40, 30);
    const test::TempFolder folder;
    const FilmMoments expected =
        render_parallel(scene, request_for(scene, folder, "bdpt", "wavefront", 1), ranks()).film;
    volatile bool interrupt = false;
    ParallelRequest request = request_for(scene, folder, "bdpt", "wavefront", 2);
    request.interrupt = &interrupt;
    request.checkpoint_seconds = 1e-3;
    request.on_progress = [&](const RenderPosition& p, const RenderStats&) {
        if (p.samples > 10) set_flag(&interrupt);
    };
    const ParallelResult part = render_parallel(scene, request, ranks());
    CHECK(part.position.interrupted);
    REQUIRE(part.state_path == folder / "state");
    REQUIRE(part.film.samples > 10);
    REQUIRE(part.film.samples < 50);
    const std::optional<RenderState> state = read_state(part.state_path);
    REQUIRE(state.has_value());
    const nlohmann::json& notes = state->notes;
    CHECK(notes.at("range_size") == 3);
    CHECK(notes.at("identity").at("spp") == 50);
    CHECK(notes.at("identity").at("settings") == settings_json(request.settings));
    CHECK(notes.at("seconds") >= part.position.seconds);
    const RenderStats saved = restore_stats(notes.at("stats"));
    CHECK(saved.samples == part.film.samples);
    CHECK(saved.rays_extend == part.stats.rays_extend);

    request = request_for(scene, folder, "bdpt", "wavefront", 3);
    try {
        render_parallel(scene, request, ranks());
        FAIL("there is a state");
    } catch (const Error& error) {
        CHECK(error.code == ExitCode::usage);
        CHECK(std::string(error.what()) == part.state_path +
                                               " holds a render that was stopped: go on with it with "
                                               "--resume, or remove the file");
    }
    request.resume = true;
    for (const char* other : {"seed", "spp", "range"}) {
        CAPTURE(other);
        ParallelRequest changed = request;
        if (other == std::string("seed")) changed.settings.seed = 99;
        if (other == std::string("spp")) changed.budget.samples = 51;
        if (other == std::string("range")) changed.range_size = 4;
        CHECK_THROWS_AS(render_parallel(scene, changed, ranks()), Error);
    }
    const ParallelResult whole = render_parallel(scene, request, ranks());
    CHECK(same(whole.film, expected));
    uint64_t rendered = 0;
    for (const WorkerShare& w : whole.workers) rendered += w.samples;
    CHECK(rendered == 50 - part.film.samples);
    CHECK(whole.position.samples == 50);
    CHECK(whole.position.seconds > notes.at("seconds"));  // both parts took some time
    CHECK(whole.stats.samples == 50);
    CHECK(whole.stats.rays_extend > part.stats.rays_extend);
    CHECK(whole.state_path.empty());
    CHECK(!std::filesystem::exists(folder / "state"));
}

TEST_CASE("a budget in seconds holds for all workers together") {
    const Scene scene = project_scene("cornell", 64, 48);
    const test::TempFolder folder;
    ParallelRequest request = request_for(scene, folder, "path", "wavefront", 2);
    request.budget = {0, 1.0};
    request.range_size = 0;
    const ParallelResult result = render_parallel(scene, request, ranks());
    // A range is a sixty-fourth of a second for one worker alone; the machine may be busy.
    CHECK(result.position.seconds > 0.8);
    CHECK(result.position.seconds < 3.0);
    CHECK(result.film.samples > result.ranges.size);
    CHECK(result.film.samples % result.ranges.size == 0);
}

TEST_CASE("what a worker throws ends the render") {
    const Scene scene = project_scene("cornell", 16, 16);
    const test::TempFolder folder;
    ParallelRequest request = request_for(scene, folder, "path", "wavefront", 2);
    request.settings.accel = AccelKind::bvh2;  // not on the CPU
    CHECK_THROWS_AS(render_parallel(scene, request, ranks()), Error);
}

TEST_CASE("what bdpt.auto has chosen once, a render that is resumed goes on with") {
    const Scene scene = project_scene("glass", 16, 12);
    const test::TempFolder folder;
    volatile bool interrupt = false;
    ParallelRequest request = request_for(scene, folder, "bdpt", "wavefront", 1);
    request.settings.automatic = true;
    request.interrupt = &interrupt;
    request.on_progress = [&](const RenderPosition&, const RenderStats&) { set_flag(&interrupt); };
    const ParallelResult part = render_parallel(scene, request, ranks());
    REQUIRE(part.position.interrupted);
    const SelectionStats& chosen = part.stats.selection;
    CHECK(chosen.seconds > 0);
    CHECK(part.position.seconds >= chosen.seconds);  // choosing is part of the render
    interrupt = false;
    request.on_progress = {};
    request.resume = true;
    const ParallelResult whole = render_parallel(scene, request, ranks());
    CHECK(whole.film.samples == 50);
    CHECK(whole.stats.selection.settings == chosen.settings);
    CHECK(whole.stats.selection.seconds == chosen.seconds);
    CHECK(whole.position.seconds > part.position.seconds);
}

TEST_CASE("what was rendered before a device failed is saved and gone on with; other errors leave no state") {
    const Scene scene = project_scene("cornell", 16, 12);
    const test::TempFolder folder;
    const auto request = [&] { return request_for(scene, folder, "path", "wavefront", 1); };
    const FilmMoments expected = render_parallel(scene, request(), ranks()).film;
    uint64_t rendered = 0;
    const auto failing = [&](ExitCode code) {
        ParallelRequest r = request();
        r.on_progress = [&, code](const RenderPosition& p, const RenderStats&) {
            rendered = p.samples;
            if (rendered > 20) throw Error(code, "the device is lost");
        };
        try {
            render_parallel(scene, r, ranks());
        } catch (const Error& error) {
            CHECK(error.code == code);
            return std::string(error.what());
        }
        return std::string("no error");
    };
    CHECK(failing(ExitCode::bad_input) == "the device is lost");
    CHECK(!std::filesystem::exists(folder / "state"));
    CHECK(failing(ExitCode::device) == "the device is lost. " + std::to_string(rendered) +
                                           " samples per pixel are in " + (folder / "state") +
                                           "; the same command with --resume goes on");
    REQUIRE(rendered > 20);
    REQUIRE(rendered < 50);
    ParallelRequest rest = request();
    rest.resume = true;
    const ParallelResult whole = render_parallel(scene, rest, ranks());
    CHECK(same(whole.film, expected));
    CHECK(whole.workers.at(0).samples == 50 - rendered);
    CHECK(!std::filesystem::exists(folder / "state"));
}

TEST_CASE("a crew renders a node on all of its devices, hands over one film for it, and has one structure for rays") {
    const Scene scene = project_scene("glass", 24, 16);
    const RenderSettings settings = cpu_settings(scene, Estimator::mis);
    const Ranges ranges = {3, 40};  // 14 ranges, of which the last has one sample
    SharedAccels host(scene);
    Crew crew(scene, settings, std::vector<Device>(3), host);
    CHECK(host.get<EmbreeAccel>().use_count() == 1 + 3 + 1);  // here, each renderer, and the question
    CHECK(crew.wanted() == 3);
    const std::vector<RangeNode> nodes = {{3, 0}, {2, 2}, {1, 6}};
    for (const RangeNode& node : nodes) crew.give({ranges, node});
    std::vector<Finished> finished;
    while (finished.size() < nodes.size())
        for (Finished& f : crew.take(1)) finished.push_back(std::move(f));
    CHECK(crew.wanted() == 3);
    MergeTree together, apart;
    double seconds = 0, worked = 0;
    for (Finished& f : finished) {
        CHECK(f.seconds > 0);
        seconds += f.seconds;
        together.add(f.order.node, std::move(f.film));
    }
    const std::unique_ptr<Renderer> one = make_renderer(scene, settings);
    for (uint64_t range = 0; range < ranges.count(); ++range) {
        one->clear_film();
        REQUIRE(one->render(ranges.first_sample(range), ranges.length(range)) == ranges.length(range));
        apart.add({0, range}, one->film());
    }
    CHECK(same(together.sum(), apart.sum()));
    uint64_t samples = 0, rendered = 0;
    for (const DeviceWork& d : crew.work()) samples += d.samples, rendered += d.ranges, worked += d.seconds;
    CHECK(seconds == Approx(worked));
    CHECK(samples == 40);
    CHECK(rendered == 14);
}

TEST_CASE("a crew whose films nobody takes ends when it is given up") {
    const Scene scene = project_scene("glass", 8, 8);
    SharedAccels host(scene);
    Crew crew(scene, cpu_settings(scene, Estimator::mis), std::vector<Device>(2), host);
    crew.give({{1, 32}, {5, 0}});
    // Each worker renders on until two of its films wait and one cannot be handed over.
    const auto ranges = [&] {
        uint64_t sum = 0;
        for (const DeviceWork& d : crew.work()) sum += d.ranges;
        return sum;
    };
    for (int i = 0; i < 1000 && ranges() < 4; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    CHECK(ranges() == 4);
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
}

TEST_CASE("ranks of a host share its devices") {
    struct Some : Ranks {
        int rank_of_host = 0, on_host = 1;
        int local_rank() const override { return rank_of_host; }
        int local_size() const override { return on_host; }
    };
    const auto names = [](int rank, int size) {
        Some some;
        some.rank_of_host = rank;
        some.on_host = size;
        std::string text;
        for (const Device& d : choose_devices({"0", "1", "2"}, {}, some)) text += d.name();
        return text;
    };
    CHECK(names(0, 1) == "012");
    CHECK(names(0, 2) == "02");
    CHECK(names(1, 2) == "1");
    CHECK(names(3, 5) == "0");
}

TEST_CASE("devices are numbers or cpu, and agree with the other options") {
    const Ranks alone;
    RenderSettings settings;
    CHECK(choose_devices({"0", "2", "cpu"}, settings, alone).size() == 3);
    CHECK(choose_devices({"0", "2", "cpu"}, settings, alone)[1].cuda == 2);
    for (const std::string name : {"gpu", "-1", "1x", ""})
        CHECK_THROWS_AS(choose_devices({name}, settings, alone), Error);
    settings.deterministic = true;
    CHECK_THROWS_AS(choose_devices({"0", "cpu"}, settings, alone), Error);
    const auto open = [&] { return choose_devices({}, settings, alone).at(0).name(); };
    CHECK(open() == (cuda_available() ? "0" : "cpu"));
    settings.backend = Backend::cuda;
    CHECK(open() == "0");
    CHECK_THROWS_AS(choose_devices({"cpu"}, settings, alone), Error);
    settings.backend = Backend::automatic;
    settings.accel = AccelKind::embree;
    CHECK(open() == "cpu");
    settings.accel = AccelKind::automatic;
    settings.precision = Precision::in_double;
    CHECK(open() == "cpu");
    settings = {};
    settings.backend = Backend::cpu;
    CHECK(open() == "cpu");
    CHECK_THROWS_AS(choose_devices({"0"}, settings, alone), Error);
}
