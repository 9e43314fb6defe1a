// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Integrators that merge on a device: the image of the CPU, and bits that depend on no size of waves.
#include <cmath>

#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

RenderSettings merging(const Scene& scene, const char* integrator) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = integrator;
    apply_setting(s, "merge_radius", "0.02");
    apply_setting(s, "merge_samples", "2");
    apply_setting(s, "deterministic", "true");
    return s;
}

}  // namespace

TEST_CASE("vcm: CPU and CUDA agree, and with deterministic=true bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"})
        for (const char* mask : {"all", "hits", "hits+next_event"})
            for (const int depth : {2, 5, -1}) {  // depth 2: the pilot sees no vertices, so that all memory has to grow
                const Scene scene = project_scene(name, 64, 48);
                RenderSettings s = merging(scene, "vcm");
                s.max_depth = depth;
                apply_setting(s, "strategies", mask);
                INFO(name << ", depth " << depth << ", " << mask);
                check_on_device(scene, s, 8);
            }
}

TEST_CASE("vcm correlated: CPU and CUDA agree, and bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"})
        for (const char* heuristic : {"balance", "power"}) {
            const Scene scene = project_scene(name, 64, 48);
            RenderSettings s = merging(scene, "vcm");
            s.variant = "correlated";
            apply_setting(s, "heuristic", heuristic);
            INFO(name << ", " << heuristic);
            check_on_device(scene, s, 8);
        }
}

TEST_CASE("What is vcm with strategies switched off: CPU and CUDA agree") {
    if (!device()) return;
    for (const char* integrator : {"bpm", "ppm", "sppm", "pm"})
        for (const char* name : {"cornell", "glass"}) {
            const Scene scene = project_scene(name, 64, 48);
            INFO(integrator << ", " << name);
            check_on_device(scene, merging(scene, integrator), 8);
        }
}

TEST_CASE(
    "What merges loses nothing where few subpaths are left, as other integrators take those through several bounces") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 64, 48);
    for (const char* integrator : {"vcm", "bpm"}) {
        INFO(integrator);
        RenderSettings s = merging(scene, integrator);
        apply_setting(s, "deterministic", "false");
        const double cpu = mean_of(render_scene(scene, s, 8).film);
        s.backend = Backend::cuda;
        CHECK(std::fabs(mean_of(render_scene(scene, s, 8).film) / cpu - 1) < 2e-3);
    }
}

TEST_CASE("Iterations that a device does at once leave the bits of one after the other") {
    if (!device()) return;
    for (const char* integrator : {"vcm", "sppm"})
        for (const char* alpha : {"0.75", "1"}) {
            INFO(integrator << ", merge_alpha " << alpha);
            const Scene scene = project_scene("cornell", 64, 48);
            RenderSettings s = merging(scene, integrator);
            apply_setting(s, "merge_alpha", alpha);
            check_on_device(scene, s, 150);
        }
}

TEST_CASE("vcm with more eye vertices than merge in the order in which they come: CPU and CUDA agree") {
    if (!device()) return;
    const Scene scene = project_scene("glass", 256, 192);
    check_on_device(scene, merging(scene, "vcm"), 4);
}
