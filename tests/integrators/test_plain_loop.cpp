// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 120
// G10: the wavefront of the CPU against a plain loop over pixels and samples that calls the same functions: the same
// image here, the same time in scripts/bench/bench_guard.py, which runs the hidden case [.bench].
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "accel/embree_tracer.h"
#include "core/parallel.h"
#include "integrators/feature_levels.h"
#include "integrators/path/integrator.h"
#include "tests/support/plain_path.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using test::plain_sample;

namespace {

/// Sums of samples [0, spp) of every pixel, tiles dealt to all threads.
std::vector<double> plain_loop(const Scene& scene, const RenderSettings& settings, uint32_t spp, double& seconds) {
    const SceneView view = scene.view();
    const EmbreeAccel accel(scene);
    const EmbreeTracer tracer = accel.tracer();
    const Rules<UnidirectionalMis> rules = plan_path(scene, settings).rules;
    const uint32_t width = scene.sensor.crop_width, height = scene.sensor.crop_height, side = 16,
                   across = (width + side - 1) / side, down = (height + side - 1) / side;
    std::vector<double> sums(size_t(width) * height * 3, 0.0);
    const auto start = std::chrono::steady_clock::now();
    with_feature_level(scene.features, true, [&]<Features F>() {
        parallel_for(across * down, [&](uint32_t tile) {
            const uint32_t x0 = tile % across * side, y0 = tile / across * side;
            for (uint32_t y = y0; y < std::min(y0 + side, height); ++y)
                for (uint32_t x = x0; x < std::min(x0 + side, width); ++x)
                    for (uint32_t s = 0; s < spp; ++s) {
                        const PathSlot p = {x, y, y * width + x, s, true};
                        const Rgb v = plain_sample<F>(view, tracer, rules, p, {settings.seed, p.pixel, s, Stream::eye});
                        for (int c = 0; c < 3; ++c) sums[size_t(p.pixel) * 3 + size_t(c)] += double(v[c]);
                    }
        });
    });
    seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return sums;
}

}  // namespace

TEST_CASE("G10: a plain loop over the same functions renders the wavefront's image") {
    for (const char* name : {"cornell", "glass", "materials", "lights", "textured", "furnace"}) {
        INFO(name);
        const Scene scene = project_scene(name, 48, 40);
        const RenderSettings settings = cpu_settings(scene, Estimator::mis);
        const RenderResult wave = render_scene(scene, settings, 4);
        double seconds;
        const std::vector<double> plain = plain_loop(scene, settings, 4, seconds);
        REQUIRE(plain.size() == wave.film.sum.size());
        double mean = 0;
        for (const double v : plain) mean += v / double(plain.size());
        size_t different = 0;
        for (size_t i = 0; i < plain.size(); ++i)
            different += std::fabs(plain[i] - wave.film.sum[i]) > 1e-4 * (std::fabs(plain[i]) + mean);
        // Copies of a function are rounded differently, and a decision may then fall otherwise.
        CHECK(different <= plain.size() / 500);
    }
}

/// Prints seconds of the loop and of the wavefront, run by run, in turns. AMBILUX_BENCH_SCENE, _RUNS, _SPP.
TEST_CASE("bench: the plain loop and the wavefront", "[.bench]") {
    const auto from = [](const char* name, const char* otherwise) {
        const char* value = std::getenv(name);
        return std::string(value ? value : otherwise);
    };
    const Scene scene = load_mitsuba(from("AMBILUX_BENCH_SCENE", AMBILUX_SOURCE_DIR "/scenes/cornell.xml"));
    const RenderSettings settings = cpu_settings(scene, Estimator::mis);
    const uint32_t spp = uint32_t(std::stoul(from("AMBILUX_BENCH_SPP", "16"))),
                   runs = uint32_t(std::stoul(from("AMBILUX_BENCH_RUNS", "5")));
    for (uint32_t run = 0; run < runs; ++run) {
        double plain;
        plain_loop(scene, settings, spp, plain);
        const RenderResult wave = render_scene(scene, settings, spp);
        std::printf("bench: plain %.6f wavefront %.6f\n", plain, wave.stats.render_seconds);
    }
}
