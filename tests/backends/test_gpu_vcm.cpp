// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Integrator vcm on a device: the image of the CPU, and bits that depend on no size of waves.
#include "tests/support/gpu_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

double mean_of(const FilmMoments& film) {
    double sum = 0;
    for (const double v : film.sum) sum += v;
    return sum / double(film.sum.size()) / double(film.samples);
}

}  // namespace

TEST_CASE("vcm: CPU and CUDA agree, and with deterministic=true bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"})
        for (const char* mask : {"all", "hits", "hits+next_event"})
            for (const int depth : {2, 5, -1}) {  // depth 2: the pilot sees no vertices, so that all memory has to grow
                const Scene scene = project_scene(name, 64, 48);
                RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
                s.integrator = "vcm";
                s.max_depth = depth;
                apply_setting(s, "strategies", mask);
                apply_setting(s, "merge_radius", "0.02");
                apply_setting(s, "merge_samples", "2");
                apply_setting(s, "deterministic", "true");
                INFO(name << ", depth " << depth << ", " << mask);
                const double on_cpu = mean_of(render_scene(scene, s, 8).film);
                s.backend = "cuda";
                const RenderResult one = render_scene(scene, s, 8);
                CHECK(mean_of(one.film) == Approx(on_cpu).epsilon(2e-3));
                CHECK(one.stats.invalid.total() == 0);
                for (const uint32_t wave_size : {1024u, 4096u, 1u << 16}) {
                    s.wave_size = wave_size;
                    const RenderResult other = render_scene(scene, s, 8);
                    CHECK(other.film.sum == one.film.sum);
                    CHECK(other.film.sum_squares == one.film.sum_squares);
                }
                s.wave_size = 0;
                s.graph = false;
                CHECK(render_scene(scene, s, 8).film.sum == one.film.sum);
            }
}
