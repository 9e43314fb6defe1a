// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: statistical
// timeout: 900
// seconds: 12
// long: tagged
// Strategies (s,t) one by one: their images beside a render, and as masks.
#include <cmath>

#include "core/error.h"
#include "film/strategy_film.h"
#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

RenderSettings single(const Scene& scene, uint32_t s, uint32_t t, uint64_t seed) {
    return method_settings(scene, {"s" + std::to_string(s) + "t" + std::to_string(t)}, seed);
}

/// Mean image and the images of its strategies.
struct Gathered {
    FilmMoments film;
    std::vector<StrategyImage> images;
};

Gathered gather(const Scene& scene, RenderSettings settings, uint32_t depth, uint32_t spp) {
    settings.technique_depth = depth;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    REQUIRE(renderer->render(0, spp) == spp);
    return {renderer->film(), renderer->strategy_images()};
}

bool close(double a, double b) { return std::abs(a - b) <= 2e-5 * std::max(std::abs(a), std::abs(b)) + 1e-7; }

}  // namespace

TEST_CASE("Images of strategies are numbered without gaps") {
    uint32_t next = 0;
    for (uint32_t k = 1; k <= kMaxStrategyDepth; ++k)
        for (uint32_t s = 0; s <= k; ++s) CHECK(strategy_index(Strategy::make(s, k + 1 - s)) == next++);
    CHECK(strategy_count(kMaxStrategyDepth) == next);
    next = 0;
    for (uint32_t k = 2; k <= kMaxStrategyDepth; ++k)
        for (uint32_t s = 2; s <= k; ++s) CHECK(merge_index(s, k + 2 - s) == next++);
    CHECK(merge_count(kMaxStrategyDepth) == next);
}

TEST_CASE("Images of single strategies change no bit of the image, and their weighted ones add up to it",
          "[bidirectional]") {
    for (auto [name, depth] : {std::pair{"cornell", 4}, {"glass", 5}, {"lights", 3}, {"textured", 3}}) {
        INFO(name);
        Scene scene = project_scene(name, 24, 16);
        scene.integrator.max_depth = depth;
        for (const char* variant : {"wavefront", "lvc", "streaming"}) {
            INFO(variant);
            RenderSettings settings = method_settings(scene, kAll, 5);
            settings.variant = variant;
            const Gathered with = gather(scene, settings, uint32_t(depth), 16);
            // The cache of lvc holds the subpaths of one task, whose order is that of threads: its images are compared
            // within the same render only.
            if (settings.variant == "wavefront") {
                const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
                REQUIRE(renderer->render(0, 16) == 16);
                const FilmMoments without = renderer->film();
                CHECK(without.sum == with.film.sum);
                CHECK(without.sum_squares == with.film.sum_squares);
                CHECK(renderer->strategy_images().empty());
            }
            REQUIRE(with.images.size() == strategy_count(uint32_t(depth)));
            size_t differ = 0;
            for (size_t i = 0; i < with.film.sum.size(); ++i) {
                double total = 0;
                for (const StrategyImage& image : with.images) total += image.weighted[i];
                differ += !close(total, with.film.mean(i));
            }
            CHECK(differ == 0);
            for (const StrategyImage& image : with.images) CHECK(image.dropped == 0);
        }
    }
}

TEST_CASE(
    "Images of merges: no bit of the image changes, weighted ones add up to it, raw ones to those of other strategies",
    "[bidirectional]") {
    for (auto [name, depth] : {std::pair{"cornell", 4}, {"glass", 5}}) {
        Scene scene = project_scene(name, 24, 16);
        scene.integrator.max_depth = depth;
        for (const char* integrator : {"vcm", "bpm", "sppm"}) {
            INFO(name << ", " << integrator);
            RenderSettings settings = method_settings(scene, kAll, 5);
            settings.integrator = integrator;
            const Gathered with = gather(scene, settings, uint32_t(depth), 16);
            CHECK(render_scene(scene, settings, 16).film.sum == with.film.sum);
            REQUIRE(with.images.size() == StrategyFilm::images(uint32_t(depth), true));
            size_t differ = 0;
            for (size_t i = 0; i < with.film.sum.size(); ++i) {
                double total = 0;
                for (const StrategyImage& image : with.images) total += image.weighted[i];
                differ += !close(total, with.film.mean(i));
            }
            CHECK(differ == 0);
        }
    }
    // Paths of two segments by a merge, and by next event estimation.
    Scene scene = project_scene("cornell", 24, 16);
    scene.integrator.max_depth = 2;
    RenderSettings settings = method_settings(scene, kAll, 5);
    settings.integrator = "vcm";
    apply_setting(settings, "merge_radius", "0.01");
    apply_setting(settings, "merge_alpha", "1");
    apply_setting(settings, "light_paths", "16");
    const auto mean = [](const StrategyImage& image) {
        double sum = 0;
        for (const float v : image.raw) sum += double(v);
        return sum / double(image.raw.size());
    };
    const std::vector<StrategyImage> images = gather(scene, settings, 2, 256).images;
    const StrategyImage &next_event = images[strategy_index(Strategy::make(1, 2))], &merge = images.back();
    REQUIRE(merge.merge);
    CHECK((merge.s == 2 && merge.t == 2));
    CHECK(std::abs(mean(merge) / mean(next_event) - 1) < 0.04);  // a hundredth of chance, and edges
}

TEST_CASE("A single strategy as a mask is its raw image", "[bidirectional]") {
    for (const char* name : {"cornell", "glass", "lights"}) {
        INFO(name);
        Scene scene = project_scene(name, 24, 16);
        scene.integrator.max_depth = 4;
        const Gathered all = gather(scene, method_settings(scene, kAll, 7), 4, 8);
        for (const StrategyImage& image : all.images) {
            INFO("(" << image.s << "," << image.t << ")");
            const FilmMoments alone = render_scene(scene, single(scene, image.s, image.t, 7), 8).film;
            size_t differ = 0;
            for (size_t i = 0; i < alone.sum.size(); ++i) differ += !close(alone.mean(i), image.raw[i]);
            CHECK(differ == 0);
        }
    }
}

namespace {

/// Strategies of paths of `first` to `last` segments.
void check_strategies(uint32_t first, uint32_t last) {
    // Smooth light of a large lamp and no corners: even connections (1/distance²) have little variance.
    const std::string open = kPlane +
                             "<shape type='rectangle'><transform name='to_world'><scale value='0.7'/><rotate x='1' "
                             "angle='50'/><translate y='0.6' z='0.8'/></transform><bsdf type='twosided'>" +
                             diffuse({0.8f, 0.6f, 0.7f}) + "</bsdf></shape>" +
                             lamp(0.9, 0.8, 0.1, -0.2, 2.0, kLight, diffuse({0.4f, 0.4f, 0.4f}));
    const std::string camera = "<sensor type='perspective'><float name='fov' value='60'/>" +
                               lookat("origin='0.3,-1.2,1.5' target='0,0.2,0.3' up='0,0,1'") + film(kSize) +
                               "</sensor>";
    const Scene scene = scene_from_text(scene_xml(4, camera + open));
    const Scene lit = scene_from_text(scene_xml(
        1, "<sensor type='perspective'><float name='fov' value='60'/>" +
               lookat("origin='0.3,-1.2,0.5' target='0.1,-0.2,2.0' up='0,0,1'") + film(kSize) + "</sensor>" + open));
    ZTestOptions options;
    options.block = 4;
    for (uint32_t k = first; k <= last; ++k) {
        const Scene& seen = k == 1 ? lit : scene;
        const uint32_t most = k == 1 ? 1536 : k == 2 ? 6144 : 57344;
        // Connections in the middle have the least noise.
        const uint32_t middle = (k + 1) / 2;
        const Estimate known = render_batches(seen, single(scene, middle, k + 1 - middle, 100 + middle), most / 2);
        for (uint32_t s = 0; s <= k; ++s) {
            if (s == middle) continue;
            INFO("(" << s << "," << k + 1 - s << ") against (" << middle << "," << k + 1 - middle << ")");
            const RenderSettings settings = single(scene, s, k + 1 - s, 100 + s);
            check_agreement(render_until(seen, settings, most / 8, most, known, 0.02, options), known, 0.02, options);
        }
    }
}

}  // namespace

TEST_CASE("Each strategy alone, unweighted, agrees with the others of its length", "[bidirectional]") {
    check_strategies(1, 2);
}

TEST_CASE("Each strategy alone, unweighted, agrees with the others of its length: three and four segments",
          "[bidirectional][long]") {
    check_strategies(3, 4);
}

TEST_CASE("Single strategies: what is refused, and why", "[bidirectional]") {
    for (auto [value, reason] : {std::pair{"s1t2+s2t1", "sample the same paths"},
                                 {"s1t0", "t is at least 1"},
                                 {"s0t1", "s + t from 2"},
                                 {"s1t2+light", "cannot be mixed"},
                                 {"s1", "no single strategy"},
                                 {"s40t2", "no single strategy"},
                                 {"s20t20", "s + t from 2 to 32"}}) {
        INFO(value);
        RenderSettings s;
        std::string message;
        try {
            apply_setting(s, "strategies", value);
        } catch (const Error& e) {
            message = e.what();
        }
        CHECK(message.find(reason) != std::string::npos);
        CHECK(message.find("strategies") != std::string::npos);
        CHECK_FALSE(s.singles.on);
    }
    RenderSettings s;
    apply_setting(s, "strategies", "s1t2+s2t2");
    CHECK(s.singles.on);
    apply_setting(s, "strategies", "all");
    CHECK_FALSE(s.singles.on);
    const Scene scene = project_scene("cornell", 8, 8);
    for (const char* integrator : {"path", "bdpt"}) {
        s = {};
        s.integrator = integrator;
        if (s.integrator == "bdpt") s.variant = "megakernel";
        s.technique_depth = 3;
        CHECK_THROWS_AS(make_renderer(scene, s), Error);
    }
}
