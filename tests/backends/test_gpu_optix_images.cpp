// libs: ambilux_render ambilux_integrators ambilux_backends ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 900
// Renders with OptiX: images have the expectation of those with cwbvh, memory is as planned.
#include <cmath>

#include "film/ztest.h"
#include "integrators/registry.h"
#include "scene/ray.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/long_run.h"
#include "tests/support/optix_device.h"
#include "tests/support/render_scene.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

RenderSettings on_device(const Scene& scene, const char* integrator, const char* variant, const char* accel) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.backend = "cuda";
    s.integrator = integrator;
    s.variant = variant;
    s.accel = accel;
    return s;
}

}  // namespace

TEST_CASE("Images with OptiX have the expectation of those with cwbvh") {
    if (!optix()) return;
    const std::pair<const char*, const char*> methods[] = {
        {"path", "wavefront"}, {"bdpt", "lvc"}, {"bdpt", "streaming"}};
    const uint32_t spp = is_long_run() ? 512 : 128;
    for (const char* name : first_or_all<const char*>(1, {"cornell", "materials", "textured"}))
        for (const auto& [integrator, variant] : methods) {
            const Scene scene = project_scene(name, 64, 48);
            const RenderSettings own = on_device(scene, integrator, variant, "cwbvh");
            RenderSettings s = on_device(scene, integrator, variant, "optix");
            s.seed = own.seed + 1;
            const Estimate expected = render_batches(scene, own, spp);
            INFO(name << ", " << variant);
            const ZTestResult z = z_test(render_batches(scene, s, spp), expected);
            INFO(z.report());
            CHECK(z.pass);
        }
}

TEST_CASE("Every method that launches its rays has the image of cwbvh, from the same random numbers, with OptiX") {
    if (!optix() || !is_long_run()) return;
    for (const char* name : {"cornell", "materials"}) {
        const Scene scene = project_scene(name, 64, 48);
        for (const Variant& v : variants()) {
            if (v.traits.one_kernel || v.outside) continue;
            INFO(name << ", " << v.name());
            const auto mean = [&](const char* accel) {
                const RenderSettings s = on_device(scene, v.integrator.c_str(), v.variant.c_str(), accel);
                return mean_of(render_scene(scene, s, 1024).film);
            };
            CHECK(mean("optix") == Approx(mean("cwbvh")).epsilon(5e-3));
        }
    }
}

TEST_CASE("Instances and masks have their image with OptiX") {
    if (!optix()) return;
    for (const char* bsdf : {"<bsdf type='diffuse'/>", test::kMaskBsdf}) {
        const Scene scene = test::load_forest(bsdf);
        const RenderSettings own = on_device(scene, "path", "wavefront", "cwbvh");
        RenderSettings s = on_device(scene, "path", "wavefront", "optix");
        s.seed = own.seed + 1;
        const ZTestResult z =
            z_test(to_estimate(render_scene(scene, s, 64).film), to_estimate(render_scene(scene, own, 64).film));
        INFO(z.report());
        CHECK(z.pass);
    }
}

TEST_CASE("Memory and statistics of a render with OptiX are as planned; a camera moves; what does not go is refused") {
    if (!optix()) return;
    const Scene scene = project_scene("cornell", 160, 120);
    RenderSettings s = on_device(scene, "path", "wavefront", "optix");
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    renderer->render(0, 4);
    const RenderStats stats = renderer->stats();
    CHECK(stats.accel == "optix");
    CHECK(stats.memory_bytes == stats.memory_bytes_predicted);
    const FilmMoments before = renderer->film();
    REQUIRE(renderer->move_camera());
    renderer->render(0, 4);
    const FilmMoments after = renderer->film();
    uint64_t same = 0;
    for (size_t i = 0; i < before.sum.size(); ++i)
        same += std::fabs(before.sum[i] - after.sum[i]) <= 1e-4 * std::fabs(before.sum[i]);
    CHECK(double(same) >= 0.999 * double(before.sum.size()));

    s.memory = 200 << 20;
    CHECK_NOTHROW(make_renderer(scene, s)->render(0, 1));
    s.memory = 1 << 20;
    CHECK_THROWS_AS(make_renderer(scene, s), Error);
    s.memory = 0;
    s.deterministic = true;
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("deterministic"));
    s.deterministic = false;
    s.build = Build::fast;
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("build=fast"));
}
