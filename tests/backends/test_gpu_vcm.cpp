// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Integrator vcm on a device: the image of the CPU, and bits that depend on no size of waves.
#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

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
                check_on_device(scene, s, 8);
            }
}
