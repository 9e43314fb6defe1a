// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Integrator vpl on a device: the image of the CPU, and bits that depend on no size of waves.
#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

RenderSettings vpl_settings(const Scene& scene, const char* subpaths, const char* draws) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = "vpl";
    apply_setting(s, "vpl_subpaths", subpaths);
    apply_setting(s, "vpl_draws", draws);
    apply_setting(s, "vpl_samples", "2");
    return s;
}

}  // namespace

TEST_CASE("vpl: CPU and CUDA agree, and with deterministic=true bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"})
        for (const auto& [subpaths, draws] : {std::pair("32", "0"), {"8000", "8"}})
            for (const int depth : {2, 3, -1}) {  // depth 3: the pilot sees few vertices
                const Scene scene = project_scene(name, 64, 48);
                RenderSettings s = vpl_settings(scene, subpaths, draws);
                apply_setting(s, "deterministic", "true");
                s.max_depth = depth;
                INFO(name << ", depth " << depth << ", " << subpaths << " light subpaths, " << draws << " draws");
                // One path more or less among all light vertices moves every draw: then it is their noise that differs.
                check_on_device(scene, s, std::string(draws) == "0" ? 4 : 96);
            }
}

TEST_CASE("vpl: CPU and CUDA agree where a launch has as many connections as there is room for") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass"}) {
        const Scene scene = project_scene(name, 64, 48);
        RenderSettings s = vpl_settings(scene, "64", "0");
        const double on_cpu = mean_of(render_scene(scene, s, 8).film);
        s.backend = "cuda";
        INFO(name);
        for (const uint32_t wave_size : {0u, 1024u}) {
            s.wave_size = wave_size;
            const RenderResult r = render_scene(scene, s, 8);
            CHECK(mean_of(r.film) == Approx(on_cpu).epsilon(2e-3));
            CHECK(r.stats.invalid.total() == 0);
            for (const QueueStats& q : r.stats.queues) CHECK(q.overflow == 0);
        }
    }
}
