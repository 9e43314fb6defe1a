// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Integrator photon_density on a device: the image of the CPU, whatever waves hold, and where photons had too little
// room.
#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

TEST_CASE("photon_density: CPU and CUDA agree, and bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights"})
        for (const int depth : {2, 5, -1}) {  // depth 2: the pilot sees no vertices, so that all memory has to grow
            const Scene scene = project_scene(name, 64, 48);
            RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
            s.integrator = "photon_density";
            s.max_depth = depth;
            apply_setting(s, "photon_radius", "0.05");
            apply_setting(s, "photon_samples", "2");
            INFO(name << ", depth " << depth);
            check_on_device(scene, s, 8);
        }
}
