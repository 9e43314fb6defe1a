// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 600
// Variant optimal of path on a CUDA device: the image of the path tracer, bits that depend on no size of waves, and
// less variance where light is in proportion to densities.
#include "film/ztest.h"
#include "tests/support/gpu_device.h"
#include "tests/support/optimal_settings.h"

using namespace ambilux;

TEST_CASE("optimal weights of a device have the expectation of the path tracer") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured", "lamps"}) {
        INFO(name);
        const Scene scene = project_scene(name, 48, 32);
        RenderSettings path = cpu_settings(scene, Estimator::mis, 1);
        path.backend = "cuda";
        const Estimate truth = to_estimate(render_scene(scene, path, 2048).film);
        for (const SettingTexts& own : std::vector<SettingTexts>{{}, {{"optimal_vertices", "3"}, {"rr_depth", "1"}}}) {
            RenderSettings s = optimal(scene, 2, own);
            s.backend = "cuda";
            const ZTestResult z = z_test(to_estimate(render_scene(scene, s, 2048).film), truth);
            INFO(z.report());
            CHECK(z.pass);
        }
    }
}

TEST_CASE("optimal weights: CPU and CUDA agree, and bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "materials", "lamps"}) {
        INFO(name);
        const Scene scene = project_scene(name, 64, 48);
        check_on_device(scene, optimal(scene, 3, {{"optimal_vertices", "2"}, {"deterministic", "true"}}), 16);
        RenderSettings s = optimal(scene, 3);
        s.backend = "cuda";
        const RenderResult one = render_scene(scene, s, 16);
        CHECK(one.stats.memory_bytes == one.stats.memory_bytes_predicted);
    }
}

TEST_CASE("optimal weights: a stopped render of a device goes on as it would have") {
    if (!device()) return;
    const Scene scene = project_scene("lamps", 64, 48);
    RenderSettings s = optimal(scene, 4);
    s.backend = "cuda";
    const RenderResult one = render_scene(scene, s, 16);
    const auto first = make_renderer(scene, s), second = make_renderer(scene, s);
    first->render(0, 8);
    second->load_state(first->save_state());
    second->render(8, 8);
    first->render(8, 8);
    CHECK(first->film().sum == one.film.sum);
    CHECK(first->save_state() == second->save_state());
}
