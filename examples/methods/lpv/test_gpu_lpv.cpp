// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Integrator lpv on a device: the image of the CPU, whatever waves hold.
#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

TEST_CASE("lpv: CPU and CUDA agree, and bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"})
        for (const int depth : {2, 3, -1}) {
            const Scene scene = project_scene(name, 64, 48);
            RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
            s.integrator = "lpv";
            s.max_depth = depth;
            apply_setting(s, "lpv_samples", "2");
            INFO(name << ", depth " << depth);
            check_on_device(scene, s, 8);
        }
}
