// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 900
// The path tracer on a CUDA device against the same stages on the CPU, at equal seeds.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "core/error.h"
#include "film/image.h"
#include "film/ztest.h"
#include "stages/multi_bounce.h"
#include "tests/support/gpu_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

RenderSettings on(const char* backend, RenderSettings s, const char* accel = "auto") {
    s.backend = backend;
    s.accel = accel;
    return s;
}

const StageStats& stage_of(const RenderStats& stats, const std::string& name) {
    for (const StageStats& s : stats.stages)
        if (s.name == name) return s;
    throw std::runtime_error("no stage " + name);
}

/// Items per stage and depth agree but for paths that took another way, of which each depth adds `share` of its items,
/// and a handful where those are few.
void check_counts(const RenderStats& a, const RenderStats& b, double share, const std::set<std::string>& only = {}) {
    std::map<std::string, const StageStats*> of_b;
    for (const StageStats& s : b.stages) of_b[s.name] = &s;
    for (const StageStats& s : a.stages) {
        if (!only.empty() && !only.count(s.name)) continue;
        if (s.name == "generate" || s.name == "update_film")
            continue;  // run over slots, of which a backend's tiles leave some empty
        REQUIRE(of_b.count(s.name));
        const StageStats& t = *of_b[s.name];
        const size_t depths = std::max(s.items_by_depth.size(), t.items_by_depth.size());
        for (size_t d = 0; d < depths; ++d) {
            const double x = d < s.items_by_depth.size() ? double(s.items_by_depth[d]) : 0,
                         y = d < t.items_by_depth.size() ? double(t.items_by_depth[d]) : 0;
            INFO(s.name << " at depth " << d << ": " << x << " and " << y);
            // A path that takes another way once goes on differently for the rest of its life.
            const double apart = share * double(d + 1) * std::max(x, y);
            CHECK(std::fabs(x - y) <= apart + 3 * std::sqrt(apart) + 2);
        }
    }
}

/// Share of pixels whose channels all agree within 1e-3 relative.
double agreeing_pixels(const FilmMoments& a, const FilmMoments& b) {
    REQUIRE(a.sum.size() == b.sum.size());
    uint64_t same = 0;
    for (size_t p = 0; p < a.sum.size(); p += 3) {
        bool agree = true;
        for (size_t c = p; c < p + 3; ++c)
            agree &=
                std::fabs(a.sum[c] - b.sum[c]) <= 1e-3 * std::max(std::fabs(a.sum[c]), std::fabs(b.sum[c])) + 1e-12;
        same += agree;
    }
    return double(same) / double(a.sum.size() / 3);
}

void check_parity(const Scene& scene, RenderSettings settings, uint32_t spp) {
    settings.deterministic = true;  // else the last subpaths take several bounces in one launch
    const RenderResult cuda = render_scene(scene, on("cuda", settings), spp);
    const RenderResult embree = render_scene(scene, on("cpu", settings, "embree"), spp);
    const RenderResult host = render_scene(scene, on("cpu", settings, "cwbvh"), spp);
    check_counts(cuda.stats, embree.stats, 2e-4);
    check_counts(cuda.stats, host.stats, 2e-4);
    CHECK(cuda.stats.invalid.total() == host.stats.invalid.total());
    WARN(scene.path << ": pixels that agree within 1e-3 at " << spp
                    << " spp: " << agreeing_pixels(cuda.film, embree.film) << " with Embree, "
                    << agreeing_pixels(cuda.film, host.film) << " with the host's traversal of the same structure");
}

}  // namespace

TEST_CASE("G5: counts per stage and depth on both backends, every scene of the project") {
    if (!device()) return;
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured"}) {
        const Scene scene = project_scene(name, 128, 96);
        for (const Estimator e : {Estimator::naive, Estimator::nee, Estimator::mis}) {
            INFO(name << " estimator " << int(e));
            check_parity(scene, cpu_settings(scene, e), 4);
        }
    }
}

TEST_CASE("G5: counts per stage and depth on both backends, every published scene") {
    if (!device()) return;
    for (const char* name : {"cornell-box", "glass-and-ice", "living-room", "staircase", "veach-ajar", "veach-bidir",
                             "veach-mis", "water-caustic"}) {
        const char* folder = std::getenv("AMBILUX_DATA");
        if (!folder || !std::filesystem::exists(std::string(folder) + "/scenes/" + name)) {
            skip(std::string(name) + " is not there: skipped");
            continue;
        }
        INFO(name);
        const auto scene = published_scene(name, 160, 90);
        check_parity(*scene, cpu_settings(*scene, Estimator::mis), 4);
    }
}

TEST_CASE("The binary BVH of a device gives the images of the wide one; kernels for all features too") {
    if (!device()) return;
    for (const char* name : {"cornell", "materials", "textured"}) {
        INFO(name);
        const Scene scene = project_scene(name, 160, 90);
        RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
        s.deterministic = true;
        const RenderResult wide = render_scene(scene, s, 4);
        const RenderResult binary = render_scene(scene, on("cuda", s, "bvh2"), 4);
        CHECK(wide.stats.accel == "cwbvh");
        CHECK(binary.stats.accel == "bvh2");
        CHECK(binary.stats.memory_bytes != wide.stats.memory_bytes);
        check_counts(wide.stats, binary.stats, 2e-4);
        CHECK(agreeing_pixels(wide.film, binary.film) >= 0.99);
        RenderSettings general = s;
        general.specialise = false;
        CHECK(agreeing_pixels(wide.film, render_scene(scene, general, 4).film) >= 0.99);
    }
}

TEST_CASE("G5: pixels at 1 spp and depth 4 on both backends: cornell-box and veach-mis") {
    if (!device()) return;
    for (const char* name : {"cornell-box", "veach-mis"}) {
        const char* folder = std::getenv("AMBILUX_DATA");
        if (!folder || !std::filesystem::exists(std::string(folder) + "/scenes/" + name)) {
            skip(std::string(name) + " is not there: skipped");
            continue;
        }
        const auto scene = published_scene(name, 256, 256);
        RenderSettings s = cpu_settings(*scene, Estimator::mis);
        s.max_depth = 4;
        const RenderResult cuda = render_scene(*scene, on("cuda", s), 1);
        const double embree = agreeing_pixels(cuda.film, render_scene(*scene, on("cpu", s, "embree"), 1).film);
        const double host = agreeing_pixels(cuda.film, render_scene(*scene, on("cpu", s, "cwbvh"), 1).film);
        WARN(name << ": " << embree << " of the pixels agree with Embree, " << host << " with the host's traversal");
        CHECK(embree >= 0.995);
        CHECK(host >= 0.998);
    }
}

TEST_CASE("G7: the same seed gives the same bits on a device, whatever the wave; the next seed does not") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 160, 90);
    RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
    s.deterministic = true;
    const RenderResult first = render_scene(scene, s, 8);
    CHECK(first.film.sum == render_scene(scene, s, 8).film.sum);
    for (const uint32_t wave : {64u, 5000u, 100000u}) {
        s.wave_size = wave;
        CHECK(first.film.sum == render_scene(scene, s, 8).film.sum);
    }
    s.wave_size = 0;
    const std::unique_ptr<Renderer> parts = make_renderer(scene, s);
    parts->render(0, 3);
    parts->render(3, 5);
    CHECK(first.film.sum == parts->film().sum);
    s.seed = 2;
    CHECK(first.film.sum != render_scene(scene, s, 8).film.sum);
}

TEST_CASE("a graph and single launches give the same bits and counts") {
    if (!device()) return;
    const Scene scene = project_scene("lights", 64, 48);
    RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
    s.deterministic = true;
    const RenderResult graph = render_scene(scene, s, 6);
    s.graph = false;
    const RenderResult single = render_scene(scene, s, 6);
    CHECK(graph.film.sum == single.film.sum);
    check_counts(graph.stats, single.stats, 0);
}

TEST_CASE("the last subpaths find the same light, several depths in a launch") {
    if (!device()) return;
    for (const char* name : {"lights", "materials", "glass"}) {
        INFO(name);
        const Scene scene = project_scene(name, 160, 90);
        RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
        constexpr uint32_t kSpp = 2;
        static_assert(160 * 90 * kSpp < kMultiBounceBelow,
                      "few enough for several bounces in a launch from the first depth on");
        const RenderResult together = render_scene(scene, s, kSpp);
        s.tail = false;
        const RenderResult none = render_scene(scene, s, kSpp);
        CHECK(stage_of(together.stats, "shade").launches < stage_of(none.stats, "shade").launches);
        check_counts(together.stats, none.stats, 2e-6, {"extend", "shade"});
        const double rays = double(none.stats.rays_occlude);
        CHECK(std::fabs(double(together.stats.rays_occlude) - rays) <= 1e-5 * rays + 3);
        CHECK(agreeing_pixels(together.film, none.film) >= 0.999);
        for (const QueueStats& q : together.stats.queues) CHECK(q.overflow == 0);
        CHECK(together.stats.invalid.total() == none.stats.invalid.total());
    }
}

TEST_CASE("where items lie and in which order stages go through them changes no bit of a device's image and no count") {
    if (!device()) return;
    for (const char* name : {"lights", "materials", "textured"}) {
        const Scene scene = project_scene(name, 97, 61);
        RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
        s.deterministic = true;
        const RenderResult first = render_scene(scene, s, 6);
        for (const char* compaction : {"atomic", "select", "none"}) {
            for (const char* ordering : {"none", "material", "morton"}) {
                apply_setting(s, "compaction", compaction);
                apply_setting(s, "ordering", ordering);
                for (const auto& [graph, wave_size] : {std::pair{true, 0u}, {true, 4000u}, {false, 4000u}}) {
                    INFO(name << " compaction=" << compaction << " ordering=" << ordering << " graph=" << graph
                              << " wave_size=" << wave_size);
                    s.graph = graph;
                    s.wave_size = wave_size;
                    const RenderResult result = render_scene(scene, s, 6);
                    CHECK(first.film.sum == result.film.sum);
                    check_counts(first.stats, result.stats, 0);
                    CHECK(result.stats.invalid.total() == 0);
                    CHECK(result.stats.memory_bytes == result.stats.memory_bytes_predicted);
                    for (const QueueStats& q : result.stats.queues) CHECK(q.overflow == 0);
                }
            }
        }
    }
}

TEST_CASE("by default a device sorts hits by material where there are several types of BSDFs") {
    if (!device()) return;
    for (const auto& [name, ordering] : {std::pair{"cornell", Ordering::none}, {"materials", Ordering::material}}) {
        const Scene scene = project_scene(name, 32, 32);
        const QueuePolicy used =
            render_scene(scene, on("cuda", cpu_settings(scene, Estimator::mis)), 1).stats.settings.queues;
        CHECK(used.compaction == Compaction::atomic);
        CHECK(used.ordering == ordering);
    }
}

TEST_CASE("images of both backends have the same expectation") {
    if (!device()) return;
    for (const char* name : {"cornell", "lights", "materials", "textured", "glass"}) {
        const Scene scene = project_scene(name, 64, 48);
        RenderSettings a = cpu_settings(scene, Estimator::mis, 11),
                       b = on("cuda", cpu_settings(scene, Estimator::mis, 12));
        ZTestOptions options;
        options.same_estimator = true;
        const ZTestResult result = z_test(to_estimate(render_scene(scene, a, 256).film),
                                          to_estimate(render_scene(scene, b, 4096).film), options);
        INFO(name << "\n" << result.report());
        CHECK(result.pass);
    }
}

TEST_CASE("G3, G8: a device's queues never overflow and its memory is what was predicted") {
    if (!device()) return;
    for (const auto& [width, height] : {std::pair{64u, 64u}, {1u, 1u}, {333u, 77u}}) {
        const Scene scene = project_scene("lights", width, height);
        const RenderResult r = render_scene(scene, on("cuda", cpu_settings(scene, Estimator::mis)), 3);
        CHECK(r.stats.memory_bytes == r.stats.memory_bytes_predicted);
        CHECK(r.stats.samples == 3);
        for (const QueueStats& q : r.stats.queues) {
            CHECK(q.overflow == 0);
            CHECK(q.peak <= q.capacity);
        }
    }
}

TEST_CASE("G8: waves of a device are no larger than the render") {
    if (!device()) return;
    const Scene scene = project_scene("lights", 97, 61);
    RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
    s.deterministic = true;
    const RenderResult any = render_scene(scene, s, 3);
    s.expected_samples = 3;
    const RenderResult small = render_scene(scene, s, 3);
    CHECK(small.film.sum == any.film.sum);
    CHECK(small.stats.memory_bytes == small.stats.memory_bytes_predicted);
    CHECK(small.stats.memory_bytes < 64u << 20);
    CHECK(any.stats.memory_bytes > small.stats.memory_bytes);
    s.expected_samples = 2;  // more come than were expected
    CHECK(render_scene(scene, s, 3).film.sum == any.film.sum);
    s.expected_samples = ~uint64_t(0);
    CHECK(render_scene(scene, s, 1).stats.memory_bytes == any.stats.memory_bytes);
}

TEST_CASE("G8: more memory than the device has is refused before queues are allocated") {
    if (!device()) return;
    Scene scene = project_scene("cornell", 65535, 65536);
    RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
    try {
        make_renderer(scene, s);
        FAIL("not refused");
    } catch (const Error& error) {
        CHECK(error.code == ExitCode::device);
        CHECK(std::string(error.what()).find("MiB") != std::string::npos);
    }
}

TEST_CASE("specialised kernels and full ones give the same image") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 64, 64);
    RenderSettings s = on("cuda", cpu_settings(scene, Estimator::mis));
    const RenderResult small = render_scene(scene, s, 16);
    s.specialise = false;
    const RenderResult full = render_scene(scene, s, 16);
    check_counts(small.stats, full.stats, 2e-4);
    CHECK(small.stats.features != full.stats.features);
    CHECK(agreeing_pixels(small.film, full.film) >= 0.98);
}
