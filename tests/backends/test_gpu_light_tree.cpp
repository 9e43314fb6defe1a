// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// light_picking=tree on a device: the image of the CPU, and memory as predicted.
#include "tests/support/gpu_device.h"
#include "tests/support/many_lights.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

void check_same_image(const Scene& scene, const char* integrator, const char* variant) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = integrator;
    s.variant = variant;
    s.max_depth = 4;
    s.light_picking = LightPicks::tree;
    const uint32_t samples = std::string(variant) == "lvc" ? 256 : 8;  // draws of a cache have their own noise
    const double on_cpu = mean_of(render_scene(scene, s, samples).film);
    s.backend = "cuda";
    const RenderResult r = render_scene(scene, s, samples);
    INFO(scene.path << ", " << integrator << " " << variant);
    CHECK(mean_of(r.film) == Approx(on_cpu).epsilon(2e-3));
    CHECK(r.stats.invalid.total() == 0);
    CHECK(r.stats.memory_bytes == r.stats.memory_bytes_predicted);
    for (const QueueStats& q : r.stats.queues) CHECK(q.overflow == 0);
}

}  // namespace

TEST_CASE("Lights picked by a tree: CPU and CUDA agree") {
    if (!device()) return;
    const std::string film =
        "<sensor type='perspective'><float name='fov' value='90'/><transform name='to_world'><lookat origin='0,1,3' "
        "target='0,-0.5,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='64'/><integer "
        "name='height' value='48'/></film></sensor>";
    for (const auto& [integrator, variant] :
         {std::pair("path", "wavefront"), {"path", "ris"}, {"bdpt", "wavefront"}, {"bdpt", "lvc"}}) {
        for (const char* name : {"lights", "bathroom"})
            check_same_image(project_scene(name, 64, 48), integrator, variant);
        check_same_image(test::load(film + test::many_lamps(300, 2)), integrator, variant);
    }
}
