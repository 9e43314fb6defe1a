// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 900
// Light tracing and bidirectional path tracing on a CUDA device against the CPU, at equal seeds.
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "film/image.h"
#include "tests/support/beam_scene.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/gpu_device.h"
#include "tests/support/hidden_light_scene.h"
#include "tests/support/spherical_scene.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* integrator, const char* variant, const char* backend) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = integrator;
    s.variant = variant;
    s.backend = backend;
    return s;
}

/// Share of pixels whose channels all agree within 1e-3 relative, or within a thousandth of the image's mean.
double agreeing_pixels(const FilmMoments& a, const FilmMoments& b) {
    REQUIRE(a.sum.size() == b.sum.size());
    double mean = 0;
    for (const double v : b.sum) mean += v / double(b.sum.size());
    uint64_t same = 0;
    for (size_t p = 0; p < a.sum.size(); p += 3) {
        bool agree = true;
        for (size_t c = p; c < p + 3; ++c)
            agree &=
                std::fabs(a.sum[c] - b.sum[c]) <= 1e-3 * std::max({std::fabs(a.sum[c]), std::fabs(b.sum[c]), mean});
        same += agree;
    }
    return double(same) / double(a.sum.size() / 3);
}

/// Renders with `s` on the device, and with the same numbers on the host: pixels, rays and memory.
void check_backends(const Scene& scene, RenderSettings s, uint32_t spp) {
    const RenderResult cuda = render_scene(scene, s, spp);
    s.backend = "cpu";
    s.accel = "cwbvh";
    const RenderResult cpu = render_scene(scene, s, spp);
    const auto close = [](uint64_t a, uint64_t b) { return std::fabs(double(a) - double(b)) <= 1e-3 * double(b) + 3; };
    CHECK(agreeing_pixels(cuda.film, cpu.film) >= 0.995);
    CHECK(close(cuda.stats.rays_extend, cpu.stats.rays_extend));
    CHECK(close(cuda.stats.rays_occlude, cpu.stats.rays_occlude));
    CHECK(cuda.stats.invalid.total() == 0);
    CHECK(cuda.stats.memory_bytes == cuda.stats.memory_bytes_predicted);
    for (const QueueStats& q : cuda.stats.queues) CHECK(q.overflow == 0);
}

}  // namespace

TEST_CASE("G5: bidirectional renders of both backends at equal seeds: pixels and rays") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured", "furnace"}) {
        const Scene scene = project_scene(name, 96, 64);
        for (const auto& [integrator, variant] :
             {std::pair{"light", "wavefront"}, {"bdpt", "wavefront"}, {"bdpt", "megakernel"}, {"bdpt", "streaming"}}) {
            INFO(name << " " << integrator << " " << variant);
            RenderSettings s = settings_of(scene, integrator, variant, "cuda");
            s.max_depth = 6;
            check_backends(scene, s, 1);
        }
    }
}

TEST_CASE("G5: emitters that light subpaths alone carry, and a thin sheet: both backends find the same light") {
    if (!device()) return;
    for (const bool lamp : {false, true}) {
        const Scene scene = scene_from_text(beam_room(96, 6, lamp));
        for (const auto& [integrator, variant] :
             {std::pair{"light", "wavefront"}, {"bdpt", "wavefront"}, {"bdpt", "megakernel"}, {"bdpt", "streaming"}}) {
            INFO(lamp << " " << integrator << " " << variant);
            check_backends(scene, settings_of(scene, integrator, variant, "cuda"), 1);
        }
        // The path tracer finds the lamp alone, by way of the sheet too.
        if (lamp) check_backends(scene, settings_of(scene, "path", "wavefront", "cuda"), 4);
    }
}

/// Both backends find the same light by every variant whose image repeats.
void check_each_variant(const Scene& scene) {
    for (const auto& [integrator, variant] : {std::pair{"path", "wavefront"},
                                              {"light", "wavefront"},
                                              {"bdpt", "wavefront"},
                                              {"bdpt", "megakernel"},
                                              {"bdpt", "streaming"}}) {
        INFO(integrator << " " << variant);
        check_backends(scene, settings_of(scene, integrator, variant, "cuda"), 1);
    }
}

TEST_CASE("G5: hidden lights: both backends find the same light") {
    if (!device()) return;
    const Scene scene = scene_from_text(hidden_room(96, 6, true));
    check_each_variant(scene);
}

TEST_CASE("G5: a spherical sensor: both backends find the same light, over the edges of the film too") {
    if (!device()) return;
    const Scene scene = scene_from_text(room_around(spherical_camera(96, 48, "gaussian"), 6));
    REQUIRE(scene.features.latlong);
    check_each_variant(scene);
}

TEST_CASE("G5: any number of light subpaths: both backends start the same ones and find the same light") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"}) {
        const Scene scene = project_scene(name, 93, 61);
        for (const char* integrator : {"light", "bdpt"})
            for (const char* light_paths : {"0.109375", "0.5", "2.5", "4"}) {
                INFO(name << " " << integrator << " light_paths=" << light_paths);
                RenderSettings s = settings_of(scene, integrator, "wavefront", "cuda");
                if (s.integrator == "bdpt") apply_setting(s, "strategies", "hits+next_event+light");
                apply_setting(s, "light_paths", light_paths);
                s.max_depth = 6;
                check_backends(scene, s, 3);
            }
    }
}

TEST_CASE("any number of light subpaths gives a cache that agrees with paired subpaths") {
    if (!device()) return;
    for (const char* name : {"cornell", "lights"}) {
        const Scene scene = project_scene(name, 45, 27);
        RenderSettings s = settings_of(scene, "bdpt", "wavefront", "cuda");
        const Estimate paired = render_batches(scene, s, 4096);
        s.variant = "lvc";
        for (const char* light_paths : {"0.046875", "0.25", "3"}) {
            apply_setting(s, "light_paths", light_paths);
            INFO(name << " light_paths=" << light_paths);
            check_agreement(render_batches(scene, s, 4096, 5000), paired, 0.02);
        }
    }
}

/// Most by which pairs, or the shadow rays of such a render, differ between two runs that draw from a cache, `items` in
/// one of them: four standard deviations. Which draws may be connected is left to chance, and threads of a warp draw
/// together: over 16 seeds of glass the difference was 2.1 (pairs) and 2.4 (rays) times the root of their number, its
/// mean 0 within that of the mean.
double drawn_difference(uint64_t items) { return 4 * 2.5 * std::sqrt(double(items)); }

TEST_CASE("The last subpaths of light and eye find the same light, several depths in a launch") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "materials"}) {
        const Scene scene = project_scene(name, 160, 90);
        for (const char* variant : {"wavefront", "lvc"}) {
            INFO(name << " " << variant);
            RenderSettings s = settings_of(scene, "bdpt", variant, "cuda");
            if (s.variant == "lvc") s.connections = 2;
            const RenderResult together = render_scene(scene, s, 8);
            s.tail = false;
            const RenderResult none = render_scene(scene, s, 8);
            for (const StageStats& t : together.stats.stages)
                for (const StageStats& n : none.stats.stages) {
                    if (t.name != n.name) continue;
                    INFO(t.name);
                    // Connections of a cache are those of other vertices in every run; else subpaths differ where
                    // kernels round differently.
                    double most = 1e-5 * double(n.items) + 3;
                    if (s.variant == "lvc" && (t.name == "occlude" || t.name == "connect_vertices"))
                        most = drawn_difference(n.items);
                    CHECK(std::fabs(double(t.items) - double(n.items)) <= most);
                    if (t.name == "shade" || t.name == "light_shade") CHECK(t.launches < n.launches);
                }
            if (s.variant == "wavefront") CHECK(agreeing_pixels(together.film, none.film) >= 0.999);
            for (const QueueStats& q : together.stats.queues) CHECK(q.overflow == 0);
        }
    }
}

namespace {

StageStats stage_of(const RenderResult& r, const std::string& name) {
    for (const StageStats& t : r.stats.stages)
        if (t.name == name) return t;
    return {};
}

QueueStats queue_of(const RenderResult& r, const std::string& name) {
    for (const QueueStats& q : r.stats.queues)
        if (q.name == name) return q;
    FAIL("no queue " << name);
    return {};
}

}  // namespace

TEST_CASE(
    "Launches of a device that hold one pair of a path and those that hold as many as there is capacity for connect "
    "the same pairs") {
    if (!device()) return;
    // More pairs than a queue of one shadow ray per path has room for at first, and fewer in the end.
    const Scene scene = project_scene("cornell", 1280, 720);
    for (const char* variant : {"wavefront", "lvc"}) {
        INFO(variant);
        RenderSettings s = settings_of(scene, "bdpt", variant, "cuda");
        s.max_depth = 12;
        s.queues.ordering = Ordering::morton;  // else shadow rays of so small a structure are in no queue
        s.wave_size = 64;                      // the film in one wave all the same, but no more
        if (s.variant == "lvc") s.connections = 5;
        const RenderResult several = render_scene(scene, s, 1);
        RenderSettings other_settings = s;
        if (s.variant == "wavefront")
            other_settings.deterministic = true;
        else
            other_settings.queues.compaction = Compaction::select;
        const RenderResult one = render_scene(scene, other_settings, 1);
        const StageStats pairs = stage_of(several, "connect_vertices"), other = stage_of(one, "connect_vertices");
        CHECK(pairs.items > 1280u * 720u);
        CHECK(pairs.launches < other.launches);
        // The last subpaths are another kernel's, which rounds differently.
        const double most = s.variant == "lvc" ? drawn_difference(pairs.items) : 1e-5 * double(pairs.items) + 3;
        CHECK(std::fabs(double(pairs.items) - double(other.items)) <= most);
        if (s.variant == "wavefront") CHECK(agreeing_pixels(several.film, one.film) >= 0.999);
        for (const QueueStats& q : several.stats.queues) CHECK(q.overflow == 0);
        CHECK(queue_of(several, "deferred").peak > 0);  // there was no capacity
        // Pairs in one plane are told by rounding, and differ; those that ask for a shadow ray do not.
        s.backend = "cpu";
        const double rays = double(several.stats.rays_occlude),
                     on_host = double(render_scene(scene, s, 1).stats.rays_occlude);
        CHECK(std::fabs(rays - on_host) <=
              2e-3 * on_host + (s.variant == "lvc" ? drawn_difference(several.stats.rays_occlude) : 0.0));
    }
}

TEST_CASE("Shadow rays of pairs that are traced where they are made are those that a queue would hold") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 320, 320);
    for (const char* variant : {"wavefront", "lvc"}) {
        INFO(variant);
        RenderSettings s = settings_of(scene, "bdpt", variant, "cuda");
        const RenderResult in_place = render_scene(scene, s, 4);
        s.queues.ordering = Ordering::morton;  // of rays in queues
        const RenderResult queued = render_scene(scene, s, 4);
        CHECK(stage_of(in_place, "occlude").launches < stage_of(queued, "occlude").launches);
        for (const char* stage : {"connect_vertices", "occlude"}) {
            INFO(stage);
            const StageStats a = stage_of(in_place, stage), b = stage_of(queued, stage);
            CHECK(a.items > 100000);
            const double most = s.variant == "lvc" ? drawn_difference(b.items) : 1e-5 * double(b.items) + 3;
            CHECK(std::fabs(double(a.items) - double(b.items)) <= most);
        }
        if (s.variant == "wavefront") CHECK(agreeing_pixels(in_place.film, queued.film) >= 0.999);
        CHECK(queue_of(in_place, "deferred").capacity == 0);
        CHECK(queue_of(queued, "deferred").capacity > 0);
    }
}

TEST_CASE("G1, G7: splats of a device sum up to the same bits, whatever the wave and the launches") {
    if (!device()) return;
    const Scene scene = project_scene("glass", 80, 45);
    for (const char* variant : {"wavefront", "megakernel", "streaming"}) {
        INFO(variant);
        RenderSettings s = settings_of(scene, "bdpt", variant, "cuda");
        s.deterministic = true;  // else several pairs of a path in one launch add up in any order
        const RenderResult first = render_scene(scene, s, 6);
        CHECK(first.film.sum == render_scene(scene, s, 6).film.sum);
        s.wave_size = 4000;
        CHECK(first.film.sum == render_scene(scene, s, 6).film.sum);
        s.graph = false;
        CHECK(first.film.sum == render_scene(scene, s, 6).film.sum);
    }
}

TEST_CASE(
    "where items lie and in which order stages go through them changes no bit of bidirectional images of a device") {
    if (!device()) return;
    for (const char* name : {"glass", "lights", "materials"}) {
        const Scene scene = project_scene(name, 97, 61);
        for (const auto& [integrator, variant] :
             {std::pair{"light", "wavefront"}, {"bdpt", "wavefront"}, {"bdpt", "lvc"}, {"bdpt", "streaming"}}) {
            RenderSettings s = settings_of(scene, integrator, variant, "cuda");
            if (s.integrator == "light") apply_setting(s, "light_paths", "2.5");  // rounds use the queues again
            s.deterministic =
                s.variant != "lvc";  // contributions of one path are then added one launch after the other
            const RenderResult first = render_scene(scene, s, 8);  // first depths hold enough items to be sorted
            for (const char* compaction : {"atomic", "select", "none"}) {
                if (s.variant == "streaming" && compaction != std::string("atomic")) continue;
                for (const char* ordering : {"none", "material", "morton"}) {
                    apply_setting(s, "compaction", compaction);
                    apply_setting(s, "ordering", ordering);
                    for (const bool graph : {true, false}) {
                        INFO(name << " " << integrator << " " << variant << " compaction=" << compaction
                                  << " ordering=" << ordering << " graph=" << graph);
                        s.graph = graph;
                        const RenderResult result = render_scene(scene, s, 8);
                        CHECK(first.stats.rays_extend == result.stats.rays_extend);
                        CHECK(result.stats.invalid.total() == 0);
                        CHECK(result.stats.memory_bytes == result.stats.memory_bytes_predicted);
                        for (const QueueStats& q : result.stats.queues) CHECK(q.overflow == 0);
                        if (s.variant == "lvc") continue;  // draws from a cache whose order differs
                        CHECK(first.film.sum == result.film.sum);
                        CHECK(first.stats.rays_occlude == result.stats.rays_occlude);
                    }
                }
            }
        }
    }
}

TEST_CASE("lvc of a device over compacted and sorted queues has the expectation of paired subpaths") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 48, 32);
    const Estimate paired = render_batches(scene, settings_of(scene, "bdpt", "wavefront", "cuda"), 1024);
    for (const auto& [compaction, ordering, draws] : {std::tuple{"select", "none", "auto"},
                                                      {"none", "none", "auto"},
                                                      {"atomic", "material", "auto"},
                                                      {"none", "morton", "auto"},
                                                      {"atomic", "material", "independent"}}) {
        RenderSettings s = settings_of(scene, "bdpt", "lvc", "cuda");
        s.seed = 7;
        apply_setting(s, "compaction", compaction);
        apply_setting(s, "ordering", ordering);
        apply_setting(s, "draws", draws);
        const ZTestResult result = z_test(render_batches(scene, s, 1024), paired);
        INFO("compaction=" << compaction << " ordering=" << ordering << " draws=" << draws << "\n" << result.report());
        CHECK(result.pass);
    }
}

TEST_CASE("variants of a device give the same image up to rounding") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 96, 54);
    const RenderResult wavefront = render_scene(scene, settings_of(scene, "bdpt", "wavefront", "cuda"), 2);
    const RenderResult megakernel = render_scene(scene, settings_of(scene, "bdpt", "megakernel", "cuda"), 2);
    CHECK(agreeing_pixels(wavefront.film, megakernel.film) >= 0.99);
}

TEST_CASE("long light subpaths of a device: as on the CPU, in memory that is what was predicted") {
    if (!device()) return;
    // Long subpaths: the number of vertices of one wave scatters widely around the pilot's mean.
    Scene scene = project_scene("furnace", 16, 16);
    RenderSettings s = settings_of(scene, "bdpt", "wavefront", "cuda");
    s.max_depth = 200;
    s.rr_depth = -1;
    const RenderResult cuda = render_scene(scene, s, 2);
    s.backend = "cpu";
    s.accel = "cwbvh";
    const RenderResult cpu = render_scene(scene, s, 2);
    CHECK(agreeing_pixels(cuda.film, cpu.film) >= 0.98);
    CHECK(cuda.stats.memory_bytes == cuda.stats.memory_bytes_predicted);
}

TEST_CASE("streaming on a device: many more paths than slots, on every project scene") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured", "furnace"}) {
        INFO(name);
        const Scene scene = project_scene(name, 96, 64);
        RenderSettings s = settings_of(scene, "bdpt", "streaming", "cuda");
        s.deterministic = true;  // bits are compared
        const RenderResult wide = render_scene(scene, s, 8);
        s.wave_size = 1000;
        const RenderResult narrow = render_scene(scene, s, 8);
        CHECK(wide.film.sum == narrow.film.sum);
        CHECK(narrow.stats.memory_bytes < wide.stats.memory_bytes);
        CHECK(narrow.stats.memory_bytes == narrow.stats.memory_bytes_predicted);
        for (const QueueStats& q : narrow.stats.queues) CHECK(q.overflow == 0);
    }
}

TEST_CASE("images of single strategies on a device are those of the CPU and add up to the image") {
    if (!device()) return;
    for (const char* variant : {"wavefront", "streaming", "lvc"}) {
        INFO(variant);
        const Scene scene = project_scene("cornell", 48, 32);
        RenderSettings s = settings_of(scene, "bdpt", variant, "cuda");
        s.max_depth = 4;
        s.technique_depth = 4;
        const std::unique_ptr<Renderer> cuda = make_renderer(scene, s);
        REQUIRE(cuda->render(0, 4) == 4);
        s.backend = "cpu";
        s.accel = "cwbvh";
        const std::unique_ptr<Renderer> cpu = make_renderer(scene, s);
        REQUIRE(cpu->render(0, 4) == 4);
        const std::vector<StrategyImage> a = cuda->strategy_images(), b = cpu->strategy_images();
        REQUIRE(a.size() == b.size());
        const FilmMoments film = cuda->film();
        double worst = 0, total = 0;
        for (size_t i = 0; i < film.sum.size(); ++i) {
            double sum = 0;
            for (const StrategyImage& image : a) sum += image.weighted[i];
            worst = std::max(worst, std::fabs(sum - film.mean(i)));
            total += film.mean(i) / double(film.sum.size());
        }
        CHECK(worst < 1e-4 * total + 1e-6);
        if (s.variant == "lvc") continue;  // draws from a cache whose order differs
        for (size_t k = 0; k < a.size(); ++k) {
            INFO("(" << a[k].s << "," << a[k].t << ")");
            size_t differ = 0;
            for (size_t i = 0; i < a[k].raw.size(); ++i)
                differ += std::fabs(a[k].raw[i] - b[k].raw[i]) > 1e-3f * std::fabs(b[k].raw[i]) + 1e-5f;
            CHECK(double(differ) <= 0.01 * double(a[k].raw.size()) + 3);
        }
    }
}

TEST_CASE("lvc on a device refuses to be deterministic") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = settings_of(scene, "bdpt", "lvc", "cuda");
    s.deterministic = true;
    CHECK_THROWS_AS(make_renderer(scene, s), Error);
}
