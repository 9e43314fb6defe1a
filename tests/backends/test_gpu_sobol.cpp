// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// sampler=sobol on a device: the image of the CPU.
#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

TEST_CASE("Sobol' points: CPU and CUDA agree") {
    if (!device()) return;
    for (const auto& [integrator, variant] : {std::pair("path", "wavefront"),
                                              {"path", "ris"},
                                              {"light", "wavefront"},
                                              {"bdpt", "wavefront"},
                                              {"bdpt", "lvc"}})
        for (const char* name : {"cornell", "lights", "bathroom"}) {
            const Scene scene = project_scene(name, 64, 48);
            RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
            s.integrator = integrator;
            s.variant = variant;
            s.max_depth = 4;
            s.sampler = Sampler::sobol;
            const uint32_t samples = std::string(variant) == "lvc" ? 256 : 8;  // coherent draws are others
            const double on_cpu = mean_of(render_scene(scene, s, samples).film);
            s.backend = "cuda";
            const RenderResult r = render_scene(scene, s, samples);
            INFO(name << ", " << integrator << " " << variant);
            CHECK(mean_of(r.film) == Approx(on_cpu).epsilon(2e-3));
            CHECK(r.stats.invalid.total() == 0);
            CHECK(r.stats.memory_bytes == r.stats.memory_bytes_predicted);
        }
}
