// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 20
// Integrator photon_density: what it converges to, and that no thread, wave or budget decides a bit.
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* radius = "0.02") {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "photon_density";
    apply_setting(s, "photon_radius", radius);
    return s;
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
        INFO(samples << " samples an iteration");
        check_bits_on_cpu(scene, s, 8, 16);
    }
}

TEST_CASE("photon_density: iterations are whole, and a render goes on from its film alone") {
    const Scene scene = project_scene("cornell", 24, 24);
    RenderSettings s = settings_of(scene);
    apply_setting(s, "photon_samples", "4");
    check_resumes_from_film(scene, s);
    apply_setting(s, "light_paths", "2");
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("light_paths=2"));
}
