// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// What must not change the image of a CPU render and what must: seeds, waves, batches, threads, kernels, tracers,
// settings, interruption; and what it reports.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>

#include "backends/optix.h"
#include "core/error.h"
#include "tests/support/render_checks.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

Scene small_scene(const char* name) { return project_scene(name, 37, 29); }

RenderSettings settings_of(const Scene& scene, uint64_t seed = 5) { return cpu_settings(scene, Estimator::mis, seed); }

std::string refused(RenderSettings& s, const std::string& key, const std::string& value) {
    const RenderSettings before = s;
    try {
        apply_setting(s, key, value);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::usage);
        CHECK(before.max_depth == s.max_depth);
        return e.what();
    }
    FAIL(key << "=" << value << " was accepted");
    return {};
}

}  // namespace

TEST_CASE("G7: one seed is one image, whatever the waves, the batches and the threads", "[path]") {
    for (const char* name : {"cornell", "lights", "materials"}) {
        INFO(name);
        const Scene scene = small_scene(name);
        const RenderSettings settings = settings_of(scene);
        const FilmMoments film = check_one_image(scene, settings, 8, {64, 1000, 2048, 100000});
        RenderSettings s = settings;
        s.deterministic = true;
        CHECK(same_image(film, render_scene(scene, s, 8).film));
    }
}

TEST_CASE("G7: another seed is another image, and independent of the first", "[path]") {
    const Scene scene = project_scene("cornell", 48, 48);
    for (Estimator e : {Estimator::naive, Estimator::nee, Estimator::mis}) {
        const uint32_t n = 32;
        const FilmMoments many = render_scene(scene, cpu_settings(scene, e, 1000), 512).film;
        std::vector<FilmMoments> films;
        for (uint64_t seed : {5u, 6u, 7u}) films.push_back(render_scene(scene, cpu_settings(scene, e, seed), n).film);
        // Residuals of pixels against a better image: the channels of a pixel are one value.
        for (size_t a = 0; a < films.size(); ++a)
            for (size_t b = 0; b < a; ++b) {
                CHECK_FALSE(same_image(films[a], films[b]));
                double sum = 0, aa = 0, bb = 0, fourth = 0;
                for (size_t i = 1; i < many.sum.size(); i += 3) {
                    const double scale = std::sqrt(many.variance(i) / n);
                    if (!(scale > 0)) continue;
                    // The better image's own error is common to both: its share of the variance is n/512.
                    const double x = (films[a].mean(i) - many.mean(i)) / scale,
                                 y = (films[b].mean(i) - many.mean(i)) / scale;
                    const double u = std::clamp(x, -3.0, 3.0), v = std::clamp(y, -3.0, 3.0);
                    sum += u * v;
                    aa += u * u;
                    bb += v * v;
                    fourth += u * u * v * v;
                }
                const double common = double(n) / 512 / (1 + double(n) / 512);
                const double correlation = sum / std::sqrt(aa * bb), error = std::sqrt(fourth / (aa * bb));
                INFO("correlation " << correlation << " +- " << error << ", by the reference " << common);
                CHECK(std::abs(correlation - common) < 4 * error + 0.02);
                CHECK(error < 0.04);
            }
    }
}

TEST_CASE("Specialised kernels render the image of the full ones", "[path]") {
    for (const char* name : {"cornell", "textured", "furnace"}) {
        INFO(name);
        const Scene scene = small_scene(name);
        RenderSettings special = settings_of(scene), full = special;
        full.specialise = false;
        const RenderResult a = render_scene(scene, special, 4), b = render_scene(scene, full, 4);
        CHECK(a.stats.features.size() <= b.stats.features.size());
        // Compilers may contract other products, so that single paths part at edges; nearly all pixels are equal within
        // rounding.
        size_t equal = 0;
        for (size_t i = 0; i < a.film.sum.size(); ++i)
            equal += std::abs(a.film.sum[i] - b.film.sum[i]) <= 1e-4 * std::abs(b.film.sum[i]);
        CHECK(double(equal) >= 0.995 * double(a.film.sum.size()));
    }
}

TEST_CASE("G5, G12: Embree and the host build of the CUDA traversal agree in counts and pixels", "[path]") {
    std::vector<std::pair<std::string, Scene>> scenes;
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured"})
        scenes.emplace_back(name, project_scene(name, 128, 96));
    for (const char* name : {"cornell-box", "veach-mis"})
        if (std::optional<Scene> scene = published_scene(name, 160, 90)) scenes.emplace_back(name, std::move(*scene));
    for (const auto& [name, scene] : scenes) {
        INFO(name);
        RenderSettings embree = settings_of(scene), cwbvh = embree;
        embree.max_depth = cwbvh.max_depth = 4;
        embree.accel = "embree";
        cwbvh.accel = "cwbvh";
        const RenderResult a = render_scene(scene, embree, 1), b = render_scene(scene, cwbvh, 1);
        CHECK(a.stats.accel == "embree");
        CHECK(b.stats.accel == "cwbvh");
        size_t close = 0, all = a.film.sum.size() / 3;
        for (size_t p = 0; p < all; ++p) {
            bool same = true;
            for (size_t c = 0; c < 3; ++c)
                same = same && std::abs(a.film.sum[p * 3 + c] - b.film.sum[p * 3 + c]) <=
                                   1e-3 * std::max(std::abs(a.film.sum[p * 3 + c]), std::abs(b.film.sum[p * 3 + c]));
            close += same;
        }
        INFO(double(close) / double(all) << " of the pixels agree");
        CHECK(double(close) >= 0.995 * double(all));
        REQUIRE(a.stats.stages.size() == b.stats.stages.size());
        for (size_t s = 0; s < a.stats.stages.size(); ++s) {
            const StageStats &x = a.stats.stages[s], &y = b.stats.stages[s];
            INFO("stage " << x.name);
            REQUIRE(x.name == y.name);
            REQUIRE(x.items_by_depth.size() == y.items_by_depth.size());
            for (size_t d = 0; d < x.items_by_depth.size(); ++d) {
                INFO("depth " << d << ": " << x.items_by_depth[d] << " and " << y.items_by_depth[d]);
                const double m = double(std::max(x.items_by_depth[d], y.items_by_depth[d]));
                CHECK(std::abs(double(x.items_by_depth[d]) - double(y.items_by_depth[d])) <=
                      std::max(1e-3 * m, 3.0));  // 3: of small counts
            }
        }
    }
}

TEST_CASE("G3, G8: memory is what was predicted, queues never overflow, and counts add up", "[path]") {
    for (auto [w, h] : {std::pair{1u, 1u}, {7u, 9u}, {64u, 64u}, {200u, 123u}})
        for (uint32_t wave_size : {0u, 64u, 5000u, 100000u}) {
            INFO(w << "x" << h << " wave_size " << wave_size);
            const Scene scene = project_scene("lights", w, h);
            RenderSettings s = settings_of(scene);
            s.wave_size = wave_size;
            const RenderStats stats = render_scene(scene, s, 2).stats;
            CHECK(stats.memory_bytes > 0);
            CHECK(stats.memory_bytes == stats.memory_bytes_predicted);
            CHECK(stats.samples == 2);
            bool used = false;
            for (const QueueStats& q : stats.queues) {
                INFO(q.name);
                CHECK(q.overflow == 0);
                CHECK(q.peak <= q.capacity);
                used |= q.peak > 0;
            }
            CHECK(used);
            std::map<std::string, StageStats> stages;
            for (const StageStats& stage : stats.stages) {
                stages[stage.name] = stage;
                uint64_t sum = 0;
                for (uint64_t n : stage.items_by_depth) sum += n;
                CHECK(sum == stage.items);
                // What runs inside of another stage has its items, and its time, but no launches.
                CHECK((stage.launches > 0) == (stage.name != "connect"));
            }
            CHECK(stages["extend"].items_by_depth.at(1) == uint64_t(w) * h * 2);
            CHECK(stats.rays_extend == stages["extend"].items);
            CHECK(stats.rays_occlude == stages["occlude"].items);
            CHECK(stats.invalid.total() == 0);
        }
}

TEST_CASE("G13: every setting changes something that can be seen, or is refused", "[path]") {
    const Scene scene = small_scene("glass");
    const auto image = [&](const std::vector<std::pair<const char*, const char*>>& values) {
        RenderSettings s;
        apply_setting(s, "backend", "cpu");
        apply_setting(s, "max_depth", "8");
        for (auto [key, value] : values) apply_setting(s, key, value);
        return render_scene(scene, s, 8);
    };
    const RenderResult base = image({});
    // The image.
    for (auto [key, value] : {std::pair{"estimator", "naive"},
                              {"estimator", "nee"},
                              {"heuristic", "power"},
                              {"max_depth", "3"},
                              {"rr_depth", "1"},
                              {"rr_depth", "-1"},
                              {"seed", "18446744073709551615"}}) {
        INFO(key << "=" << value);
        CHECK_FALSE(same_image(base.film, image({{key, value}}).film));
    }
    // What the render says about itself.
    CHECK(image({{"accel", "cwbvh"}}).stats.accel == "cwbvh");
    CHECK(image({{"accel", "embree"}}).stats.accel == "embree");
    CHECK(image({{"wave_size", "64"}}).stats.queues.at(0).capacity == 64);
    CHECK(render_scene(small_scene("cornell"), settings_of(small_scene("cornell")), 1).stats.features.size() < 20);
    const Scene cornell = small_scene("cornell");
    RenderSettings full = settings_of(cornell);
    apply_setting(full, "specialise", "false");
    CHECK(render_scene(cornell, full, 1).stats.features !=
          render_scene(cornell, settings_of(cornell), 1).stats.features);
    const RenderResult staged = image({{"fuse", "none"}});
    // Stages of their own hold all features.
    CHECK(staged.film.sum == image({{"specialise", "false"}}).film.sum);
    CHECK(image({{"fuse", "auto"}}).film.sum == base.film.sum);
    CHECK(staged.stats.stages.size() > base.stats.stages.size());
    CHECK(staged.stats.memory_bytes > base.stats.memory_bytes);
    CHECK(base.stats.backend == "cpu");

    RenderSettings s;
    for (auto [key, value, allowed] : {std::tuple{"integrator", "bidirectional", "bdpt"},
                                       {"variant", "mega", "wavefront"},
                                       {"backend", "gpu", "cuda"},
                                       {"estimator", "NEE", "nee"},
                                       {"heuristic", "max", "power"},
                                       {"max_depth", "-2", "-1"},
                                       {"max_depth", "16383", "16382"},
                                       {"max_depth", "5x", "integer"},
                                       {"max_depth", "", "integer"},
                                       {"rr_depth", "-2", "-1"},
                                       {"seed", "-1", "0"},
                                       {"seed", "18446744073709551616", "18446744073709551615"},
                                       {"accel", "bvh", "cwbvh"},
                                       {"wave_size", "-5", "0"},
                                       {"wave_size", "1e6", "integer"},
                                       {"specialise", "yes", "true"},
                                       {"fuse", "some", "auto, none"},
                                       {"fuse", "light", "auto, none"},
                                       {"fuse", "all", "auto, none"},
                                       {"draws", "some", "auto, coherent, independent"},
                                       {"cull", "2", "from 0 to 1"},
                                       {"cull", "half", "number"},
                                       {"compaction", "sort", "atomic, select, none"},
                                       {"ordering", "type", "none, material, morton"},
                                       {"tail", "16", "false"},
                                       {"deterministic", "1", "false"}}) {
        const std::string message = refused(s, key, value);
        INFO(message);
        CHECK(message.find(key) != std::string::npos);
        CHECK(message.find(value) != std::string::npos);
        CHECK(message.find(allowed) != std::string::npos);
    }
    const std::string unknown = refused(s, "spp", "5");
    for (const char* part : {"'spp'", "`ambilux help settings`"}) CHECK(unknown.find(part) != std::string::npos);
}

TEST_CASE("Where items lie and in which order stages go through them changes no bit of the image and no count",
          "[path]") {
    for (const char* name : {"lights", "materials", "textured"}) {
        const Scene scene = small_scene(name);
        const RenderResult first = render_scene(scene, settings_of(scene), 4);
        for (const char* compaction : {"atomic", "select", "none"}) {
            for (const char* ordering : {"none", "material", "morton"}) {
                INFO(name << " compaction=" << compaction << " ordering=" << ordering);
                RenderSettings s = settings_of(scene);
                apply_setting(s, "compaction", compaction);
                apply_setting(s, "ordering", ordering);
                const RenderResult result = render_scene(scene, s, 4);
                CHECK(same_image(first.film, result.film));
                REQUIRE(result.stats.stages.size() == first.stats.stages.size());
                for (size_t k = 0; k < first.stats.stages.size(); ++k)
                    if (first.stats.stages[k].name !=
                        "update_film")  // once in every pass, of which a slow machine has more
                        CHECK(result.stats.stages[k].items_by_depth == first.stats.stages[k].items_by_depth);
                for (const QueueStats& q : result.stats.queues) CHECK(q.overflow == 0);  // no path pushed twice
                CHECK(result.stats.memory_bytes == result.stats.memory_bytes_predicted);
            }
        }
    }
}

TEST_CASE("By default queues of the CPU are appended to and gone through as they are", "[path]") {
    const Scene scene = small_scene("materials");
    const QueuePolicy used = render_scene(scene, settings_of(scene), 1).stats.settings.queues;
    CHECK(used.compaction == Compaction::atomic);
    CHECK(used.ordering == Ordering::none);
}

TEST_CASE("Renders that would not end or cannot be made are refused", "[path]") {
    const Scene scene = small_scene("cornell");
    RenderSettings endless = settings_of(scene);
    endless.max_depth = -1;
    endless.rr_depth = -1;
    CHECK_THROWS_WITH(make_renderer(scene, endless), ContainsSubstring("max_depth") && ContainsSubstring("rr_depth"));
    RenderSettings deep = settings_of(scene);
    deep.max_depth = 1 << 14;
    CHECK_THROWS_AS(make_renderer(scene, deep), Error);
    RenderSettings wrong = settings_of(scene);
    wrong.integrator = "metropolis";
    CHECK_THROWS_WITH(make_renderer(scene, wrong), ContainsSubstring("metropolis"));
    RenderSettings device = settings_of(scene);
    device.backend = "cuda";
    device.accel = "embree";
    CHECK_THROWS_AS(make_renderer(scene, device), Error);
    for (const char* backend : {"cpu", "cuda"}) {
        device.backend = backend;
        device.accel = "bvh2";
        device.integrator = backend == std::string("cpu") ? "path" : "bdpt";
        CHECK_THROWS_WITH(make_renderer(scene, device), ContainsSubstring("bvh2") && ContainsSubstring("cwbvh"));
    }
    device.accel = "optix";
    device.integrator = "path";
    device.backend = "cpu";
    CHECK_THROWS_WITH(make_renderer(scene, device), ContainsSubstring("accel=optix") && ContainsSubstring("cuda"));
    device.backend = "cuda";
    if (!kOptixBuilt)
        CHECK_THROWS_WITH(make_renderer(scene, device),
                          ContainsSubstring("OptiX_ROOT") && ContainsSubstring("accel=cwbvh"));
    device.variant = "megakernel";
    device.integrator = "bdpt";
    CHECK_THROWS_WITH(make_renderer(scene, device), ContainsSubstring("accel=optix: OptiX follows rays of queues"));
    RenderSettings fast = settings_of(scene);
    fast.build = Build::fast;
    CHECK_THROWS_WITH(make_renderer(scene, fast), ContainsSubstring("build=fast") && ContainsSubstring("accel=cwbvh"));
}

TEST_CASE("A structure that was built fast gives the image of the good one, and statistics say which it was") {
    const Scene scene = project_scene("cornell", 32, 32);
    RenderSettings settings = settings_of(scene);
    CHECK(make_renderer(scene, settings)->stats().settings.build == Build::good);
    settings.accel = "cwbvh";
    const RenderResult good = render_scene(scene, settings, 4);
    settings.build = Build::fast;
    const RenderResult fast = render_scene(scene, settings, 4);
    CHECK(good.stats.settings.build == Build::good);
    CHECK(fast.stats.settings.build == Build::fast);
    CHECK(good.film.sum == fast.film.sum);
}

TEST_CASE("An interrupted render holds exactly the samples that it says", "[path]") {
    const Scene scene = small_scene("cornell");
    check_interrupted(scene, settings_of(scene));
}
