// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 20
// Integrator photon_density: what it converges to, and that no thread, wave or budget decides a bit.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "core/error.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* radius = "0.02") {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "photon_density";
    apply_setting(s, "photon_radius", radius);
    return s;
}

double mean_of(const FilmMoments& film) {
    double sum = 0;
    for (const double v : film.sum) sum += v;
    return sum / double(film.sum.size()) / double(film.samples);
}

/// On so many threads.
RenderResult render_on(int threads, const Scene& scene, const RenderSettings& s, uint32_t samples) {
    RenderResult result;
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, size_t(threads));
    tbb::task_arena arena(threads);
    arena.execute([&] { result = render_scene(scene, s, samples); });
    return result;
}

}  // namespace

TEST_CASE("photon_density has the mean of the path tracer, to within its bias") {
    for (const char* name : {"cornell", "glass", "lights"}) {
        const Scene scene = project_scene(name, 48, 36);
        INFO(name);
        const double path = mean_of(render_scene(scene, cpu_settings(scene, Estimator::mis, 4), 512).film);
        const RenderResult photons = render_scene(scene, settings_of(scene, "0.01"), 64);
        CHECK(mean_of(photons.film) == Approx(path).epsilon(0.03));
        CHECK(photons.stats.invalid.total() == 0);
        for (const QueueStats& q : photons.stats.queues) CHECK(q.overflow == 0);
    }
}

TEST_CASE("photon_density: a smaller radius has less bias, and its depth is that of the path tracer") {
    const Scene scene = project_scene("cornell", 48, 36);
    RenderSettings emission = cpu_settings(scene, Estimator::mis, 3);
    RenderSettings photons = settings_of(scene);
    emission.max_depth = photons.max_depth = 1;
    CHECK(mean_of(render_scene(scene, photons, 16).film) ==
          Approx(mean_of(render_scene(scene, emission, 16).film)).epsilon(1e-6));
    for (const int depth : {2, 3}) {
        RenderSettings path = cpu_settings(scene, Estimator::mis, 4);
        path.max_depth = depth;
        const double expected = mean_of(render_scene(scene, path, 512).film);
        const auto error = [&](const char* radius) {
            RenderSettings s = settings_of(scene, radius);
            s.max_depth = depth;
            apply_setting(s, "photon_alpha", "1");
            return std::fabs(mean_of(render_scene(scene, s, 64).film) / expected - 1.0);
        };
        INFO("depth " << depth);
        CHECK(error("0.2") > error("0.02"));
        CHECK(error("0.01") < 0.03);
    }
}

TEST_CASE(
    "photon_density: the same bits for any number of threads, size of waves and budget, and where photons had too "
    "little room") {
    const Scene scene = project_scene("glass", 56, 40);
    for (const char* samples : {"1", "4"}) {
        RenderSettings s = settings_of(scene);
        apply_setting(s, "photon_samples", samples);
        const RenderResult one = render_on(1, scene, s, 8);
        const auto same = [&](const RenderResult& other) {
            CHECK(other.film.sum == one.film.sum);
            CHECK(other.film.sum_squares == one.film.sum_squares);
        };
        INFO(samples << " samples an iteration");
        same(render_on(2, scene, s, 8));
        same(render_on(7, scene, s, 8));
        for (const uint32_t wave_size : {64u, 256u, 4096u}) {
            s.wave_size = wave_size;
            same(render_on(2, scene, s, 8));
        }
        s.wave_size = 0;
        s.memory = one.stats.memory_bytes - one.stats.memory_bytes / 16;
        same(render_on(1, scene, s, 8));
    }
}

TEST_CASE("photon_density: iterations are whole, and a render goes on from its film alone") {
    const Scene scene = project_scene("cornell", 24, 24);
    RenderSettings s = settings_of(scene);
    apply_setting(s, "photon_samples", "4");
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    CHECK(renderer->iteration_samples() == 4);
    CHECK(renderer->state_kind() == StateKind::by_index);
    CHECK_THROWS_AS(renderer->render(0, 6), Error);
    renderer->render(0, 8);
    const FilmMoments whole = renderer->film();
    FilmMoments parts;
    for (const uint32_t first : {0u, 4u}) {
        const std::unique_ptr<Renderer> another = make_renderer(scene, s);
        another->render(first, 4);
        const FilmMoments film = another->film();
        if (first == 0) {
            parts = film;
        } else {
            for (size_t i = 0; i < film.sum.size(); ++i) parts.sum[i] += film.sum[i];
        }
    }
    for (size_t i = 0; i < whole.sum.size(); ++i) CHECK(parts.sum[i] == Approx(whole.sum[i]).epsilon(1e-12));
}
