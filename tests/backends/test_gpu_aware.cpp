// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 600
// Variant aware of bdpt on a CUDA device.
#include "tests/support/bidirectional_images.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* variant, const char* backend, uint64_t seed) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.integrator = "bdpt";
    s.variant = variant;
    s.backend = backend;
    if (variant == std::string("aware")) apply_setting(s, "connections_map", "5x3:012484810224810");
    return s;
}

}  // namespace

TEST_CASE("a number of connections for each pixel on a device has the expectation of lvc, and of the CPU") {
    if (!device()) return;
    for (const char* name : {"cornell", "materials", "textured"}) {
        const Scene scene = project_scene(name, 48, 32);
        const auto render = [&](const char* variant, const char* backend, const char* draws, uint64_t seed) {
            RenderSettings s = settings_of(scene, variant, backend, seed);
            if (*draws) apply_setting(s, "draws", draws);
            return render_batches(scene, s, 512);
        };
        const Estimate uniform = render("lvc", "cuda", "", 1), host = render("aware", "cpu", "", 2);
        for (const char* draws : {"coherent", "independent"}) {
            const Estimate own = render("aware", "cuda", draws, 3);
            for (const Estimate* other : {&uniform, &host}) {
                const ZTestResult z = z_test(own, *other);
                INFO(name << ", " << draws << ": " << z.report());
                CHECK(z.pass);
            }
        }
    }
}

TEST_CASE("so it has with and without a graph, in memory as predicted") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 48, 32);
    const Estimate paired = render_batches(scene, settings_of(scene, "wavefront", "cuda", 1), 1024);
    for (const bool graph : {true, false}) {
        RenderSettings s = settings_of(scene, "aware", "cuda", 7);
        s.graph = graph;
        const ZTestResult z = z_test(render_batches(scene, s, 1024), paired);
        INFO("graph=" << graph << ": " << z.report());
        CHECK(z.pass);
        const RenderResult r = render_scene(scene, s, 8);
        CHECK(r.stats.invalid.total() == 0);
        CHECK(r.stats.memory_bytes == r.stats.memory_bytes_predicted);
    }
}
