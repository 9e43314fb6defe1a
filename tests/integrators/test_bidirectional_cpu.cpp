// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// What must not change the image of light tracing and bidirectional path tracing on the CPU and what must; memory that
// grows; settings.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <thread>

#include "core/error.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/closed_forms.h"
#include "tests/support/render_checks.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const Method& m = {"all"}) { return method_settings(scene, m, 5); }

uint64_t queue_peak(const RenderStats& stats, const std::string& name) {
    for (const QueueStats& q : stats.queues)
        if (q.name == name) return q.peak;
    return 0;
}

uint64_t queue_capacity(const RenderStats& stats, const std::string& name) {
    for (const QueueStats& q : stats.queues)
        if (q.name == name) return q.capacity;
    return 0;
}

void check_queues(const RenderStats& stats) {
    for (const QueueStats& q : stats.queues) {
        INFO(q.name);
        CHECK(q.overflow == 0);
        CHECK(q.peak <= q.capacity);
    }
}

/// Closed sphere that radiates inwards, of albedo 0.95: subpaths are as long as max_depth lets them.
Scene long_subpaths(uint32_t size = 24) {
    const std::string n = std::to_string(size);
    return scene_from_text(
        scene_xml(40, "<sensor type='perspective'><float name='near_clip' value='1e-4'/>" + square_film(size) +
                          "</sensor><shape type='sphere'><boolean name='flip_normals' value='true'/>" +
                          diffuse({0.95f, 0.95f, 0.95f}) + area_light({1, 1, 1}) + "</shape>"));
}

}  // namespace

TEST_CASE("G7: one seed is one image, whatever the waves, the batches and the threads", "[bidirectional]") {
    for (const char* name : {"cornell", "lights", "materials", "textured"}) {
        const Scene scene = project_scene(name, 37, 29);
        for (const Method& m : kMethods) {
            INFO(name << " " << m.name);
            const RenderSettings settings = settings_of(scene, m);
            const FilmMoments film = check_one_image(scene, settings, 4, {64, 1000, 100000});
            RenderSettings other = settings;
            other.seed = 6;
            CHECK_FALSE(same_image(film, render_scene(scene, other, 4).film));
        }
    }
}

TEST_CASE("G7: eye subpaths and light subpaths of one seed share no random numbers", "[bidirectional]") {
    // With the same numbers at both ends, hits and splats of one sample would be correlated: seen in the variance of
    // all strategies together.
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings eye = settings_of(scene, {"hits"}), light = settings_of(scene, {"light"});
    const FilmMoments a = render_scene(scene, eye, 256).film, b = render_scene(scene, light, 256).film;
    const std::unique_ptr<Renderer> x = make_renderer(scene, eye), y = make_renderer(scene, light);
    double product = 0, xx = 0, yy = 0;
    for (uint32_t s = 0; s < 256; ++s) {
        x->clear_film();
        y->clear_film();
        REQUIRE(x->render(s, 1) == 1);
        REQUIRE(y->render(s, 1) == 1);
        const FilmMoments p = x->film(), q = y->film();
        for (size_t i = 0; i < p.sum.size(); i += 3) {
            const double u = p.sum[i] - a.mean(i), v = q.sum[i] - b.mean(i);
            product += u * v;
            xx += u * u;
            yy += v * v;
        }
    }
    CHECK(std::abs(product / std::sqrt(xx * yy)) < 4 / std::sqrt(256.0 * 256));
}

TEST_CASE("Specialised kernels render the image of the full ones", "[bidirectional]") {
    for (const char* name : {"cornell", "furnace", "textured"}) {
        INFO(name);
        const Scene scene = project_scene(name, 37, 29);
        RenderSettings special = settings_of(scene), full = special;
        full.specialise = false;
        const FilmMoments a = render_scene(scene, special, 4).film, b = render_scene(scene, full, 4).film;
        size_t equal = 0;
        for (size_t i = 0; i < a.sum.size(); ++i) equal += std::abs(a.sum[i] - b.sum[i]) <= 1e-3 * std::abs(b.sum[i]);
        INFO(double(equal) / double(a.sum.size()) << " of the values are equal");
        CHECK(double(equal) >= 0.99 * double(a.sum.size()));
    }
}

TEST_CASE("G5, G12: Embree and the host build of the CUDA traversal agree in counts and pixels", "[bidirectional]") {
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured"}) {
        INFO(name);
        const Scene scene = project_scene(name, 96, 64);
        RenderSettings embree = settings_of(scene), cwbvh = embree;
        embree.max_depth = cwbvh.max_depth = 4;
        embree.accel = "embree";
        cwbvh.accel = "cwbvh";
        const RenderResult a = render_scene(scene, embree, 1), b = render_scene(scene, cwbvh, 1);
        size_t close = 0;
        const size_t pixels = a.film.sum.size() / 3;
        for (size_t p = 0; p < pixels; ++p) {
            bool same = true;
            for (size_t c = 0; c < 3; ++c)
                same = same && std::abs(a.film.sum[p * 3 + c] - b.film.sum[p * 3 + c]) <=
                                   2e-3 * std::max(a.film.sum[p * 3 + c], b.film.sum[p * 3 + c]);
            close += same;
        }
        INFO(double(close) / double(pixels) << " of the pixels agree");
        CHECK(double(close) >= 0.99 * double(pixels));
        REQUIRE(a.stats.stages.size() == b.stats.stages.size());
        for (size_t s = 0; s < a.stats.stages.size(); ++s) {
            const StageStats &x = a.stats.stages[s], &y = b.stats.stages[s];
            INFO("stage " << x.name);
            REQUIRE(x.name == y.name);
            REQUIRE(x.items_by_depth.size() == y.items_by_depth.size());
            for (size_t d = 0; d < x.items_by_depth.size(); ++d) {
                INFO("depth " << d << ": " << x.items_by_depth[d] << " and " << y.items_by_depth[d]);
                CHECK(std::abs(double(x.items_by_depth[d]) - double(y.items_by_depth[d])) <=
                      std::max(1e-3 * double(std::max(x.items_by_depth[d], y.items_by_depth[d])), 4.0));
            }
        }
    }
}

TEST_CASE("G3, G8: memory is what was predicted, queues never overflow, and counts add up", "[bidirectional]") {
    for (auto [w, h] : {std::pair{1u, 1u}, {7u, 9u}, {64u, 64u}, {200u, 23u}})
        for (uint32_t wave_size : {0u, 64u, 5000u, 100000u})
            for (const char* name : {"all", "-i light"}) {
                INFO(w << "x" << h << " wave_size " << wave_size << " " << name);
                const Scene scene = project_scene("lights", w, h);
                RenderSettings s = settings_of(scene, {name});
                s.wave_size = wave_size;
                const RenderStats stats = render_scene(scene, s, 2).stats;
                CHECK(stats.memory_bytes > 0);
                CHECK(stats.memory_bytes == stats.memory_bytes_predicted);
                CHECK(stats.samples == 2);
                check_queues(stats);
                std::map<std::string, StageStats> stages;
                uint64_t traced = 0;
                for (const StageStats& stage : stats.stages) {
                    stages[stage.name] = stage;
                    uint64_t sum = 0;
                    for (uint64_t n : stage.items_by_depth) sum += n;
                    CHECK(sum == stage.items);
                    if (stage.name == "extend" || stage.name == "light_extend") traced += stage.items;
                }
                CHECK(stages["extend"].items_by_depth.at(1) == uint64_t(w) * h * 2);
                CHECK(stages["light_extend"].items_by_depth.at(1) <= uint64_t(w) * h * 2);
                CHECK(stats.rays_extend == traced);
                CHECK(stats.rays_occlude == stages["occlude"].items);
                CHECK(stats.invalid.total() == 0);
            }
}

TEST_CASE("Stages that run inside of others on a host have items and times of their own", "[bidirectional]") {
    const Scene scene = project_scene("cornell", 64, 64);
    for (RenderSettings s : {cpu_settings(scene, Estimator::mis, 5), settings_of(scene)}) {
        INFO(s.integrator);
        const RenderStats fused = render_scene(scene, s, 4).stats;
        s.fuse = Fuse::none;
        const RenderStats unfused = render_scene(scene, s, 4).stats;
        double seconds = 0;
        std::map<std::string, StageStats> of_fused;
        for (const StageStats& stage : fused.stages) {
            of_fused[stage.name] = stage;
            seconds += stage.seconds;
        }
        for (const StageStats& stage : unfused.stages) {
            INFO(stage.name);
            if (!stage.name.starts_with("connect") && stage.name != "occlude") continue;
            CHECK(of_fused[stage.name].items == stage.items);
            CHECK(of_fused[stage.name].seconds > 0);
        }
        CHECK(of_fused.size() >= 6);
        // What is taken off the stage around them is theirs: no thread is busy for longer than there is time.
        CHECK(seconds <= 1.02 * fused.render_seconds * std::thread::hardware_concurrency());
    }
}

TEST_CASE(
    "G3: a wave with more light vertices than there is room for is done again, and its image is that of any other",
    "[bidirectional]") {
    const Scene scene = long_subpaths();
    for (const char* name : {"all", "connections", "-i light"}) {
        INFO(name);
        RenderSettings s = settings_of(scene, {name});
        s.rr_depth = -1;
        const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
        REQUIRE(renderer->render(0, 2) == 2);
        const RenderStats first = renderer->stats();
        // 38 vertices per subpath and more do not fit into what there was to begin with.
        const std::string kept = std::string(name) == "-i light" ? "splats" : "light_vertices";
        CHECK(queue_peak(first, kept) > 0);
        CHECK(queue_capacity(first, kept) >= queue_peak(first, kept));
        check_queues(first);
        // Now there is room; nothing is done again.
        const FilmMoments film = renderer->film();
        renderer->clear_film();
        REQUIRE(renderer->render(0, 2) == 2);
        CHECK(same_image(film, renderer->film()));
        for (uint32_t wave_size : {64u, 128u, 100000u}) {
            s.wave_size = wave_size;
            const RenderResult r = render_scene(scene, s, 2);
            CHECK(same_image(film, r.film));
            check_queues(r.stats);
        }
        CHECK(first.invalid.total() == 0);
    }
    // One segment less room than a subpath needs, no subpath at all, and every depth between.
    for (int depth : {1, 2, 3, 4, 5, 6, 7}) {
        RenderSettings s = settings_of(scene);
        s.rr_depth = -1;
        s.max_depth = depth;
        const RenderResult r = render_scene(scene, s, 1);
        check_queues(r.stats);
        CHECK(r.stats.invalid.total() == 0);
        CHECK((queue_peak(r.stats, "light_vertices") > 0) == (depth >= 3));
    }
}

TEST_CASE("An interrupted render holds exactly the samples that it says", "[bidirectional]") {
    const Scene scene = project_scene("cornell", 37, 29);
    for (const char* name : {"all", "-i light"}) check_interrupted(scene, settings_of(scene, {name}));
}

// ---- settings ----

TEST_CASE("G13: settings of bidirectional methods change something that can be seen, or are refused",
          "[bidirectional]") {
    const Scene scene = project_scene("cornell", 37, 29);
    const auto image = [&](const std::vector<std::pair<const char*, const char*>>& values) {
        RenderSettings s;
        for (auto [key, value] : {std::pair{"backend", "cpu"}, {"integrator", "bdpt"}, {"max_depth", "5"}})
            apply_setting(s, key, value);
        for (auto [key, value] : values) apply_setting(s, key, value);
        return render_scene(scene, s, 4).film;
    };
    const FilmMoments base = image({});
    CHECK(same_image(base, image({{"strategies", "all"}})));
    CHECK(same_image(base, image({{"strategies", "hits+next_event+connections+light"}})));
    CHECK(same_image(base, image({{"strategies", "light+connections+next_event+hits"}})));
    for (auto [key, value] : {std::pair{"strategies", "hits"},
                              {"strategies", "next_event"},
                              {"strategies", "connections"},
                              {"strategies", "light"},
                              {"strategies", "hits+light"},
                              {"heuristic", "power"},
                              {"max_depth", "4"},
                              {"rr_depth", "1"},
                              {"seed", "3"},
                              {"integrator", "light"},
                              {"integrator", "path"}}) {
        INFO(key << "=" << value);
        CHECK_FALSE(same_image(base, image({{key, value}})));
    }
    // The light tracer is bdpt with its one family of strategies.
    CHECK(same_image(image({{"integrator", "light"}}), image({{"strategies", "light"}})));

    RenderSettings s;
    for (const char* value : {"nonsense", "", "hits+", "+hits", "hits+nonsense", "hits,light", "ALL", "hits + light"}) {
        INFO("strategies=" << value);
        try {
            apply_setting(s, "strategies", value);
            FAIL("accepted");
        } catch (const Error& e) {
            const std::string message = e.what();
            INFO(message);
            CHECK(e.code == ExitCode::usage);
            for (const char* allowed : {"strategies", value, "hits", "next_event", "connections", "light", "all"})
                CHECK(message.find(allowed) != std::string::npos);
        }
        CHECK(s.strategies == kAllStrategies);
    }
}

TEST_CASE("Renders that would not end are refused, and scenes without light are black", "[bidirectional]") {
    const Scene scene = project_scene("cornell", 16, 16);
    for (const char* name : {"bdpt", "light"}) {
        RenderSettings s = settings_of(scene);
        s.integrator = name;
        s.max_depth = s.rr_depth = -1;
        CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("max_depth") && ContainsSubstring("rr_depth"));
    }
    Scene dark = scene_from_text(
        scene_xml(4, "<sensor type='perspective'>" + square_film(8) + "</sensor><shape type='sphere'/>"));
    for (const Method& m : kMethods) check_black(render_scene(dark, settings_of(dark, m), 4));
    const Scene empty = scene_from_text(
        scene_xml(4, "<sensor type='perspective'>" + square_film(8) + "</sensor><emitter type='constant'/>"));
    for (const char* name : {"all", "-i light", "hits"}) {
        const FilmMoments film = render_scene(empty, settings_of(empty, {name}), 4).film;
        CHECK(std::all_of(film.sum.begin(), film.sum.end(), [](double v) { return v == 4; }));
    }
    check_black(render_scene(empty, settings_of(empty, {"next_event+connections"}), 4));
}
