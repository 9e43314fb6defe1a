// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 600
// Variants guided on a CUDA device: the image of the path tracer and, of path, bits that depend on no size of waves.
#include "film/ztest.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/gpu_device.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

RenderSettings guided(const Scene& scene, uint64_t seed) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.variant = "guided";
    apply_setting(s, "guide_split", "256");
    apply_setting(s, "guide_samples", "4");
    apply_setting(s, "deterministic", "true");
    return s;
}

}  // namespace

TEST_CASE("guided paths of a device have the expectation of the path tracer") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured", "door"}) {
        INFO(name);
        const Scene scene = project_scene(name, 48, 32);
        RenderSettings path = cpu_settings(scene, Estimator::mis, 1), s = guided(scene, 2);
        path.backend = s.backend = "cuda";
        for (const char* target : {"radiance", "moment"}) {
            apply_setting(s, "guide_target", target);
            const ZTestResult z = z_test(to_estimate(render_scene(scene, s, 2048).film),
                                         to_estimate(render_scene(scene, path, 2048).film));
            INFO(target << ": " << z.report());
            CHECK(z.pass);
        }
    }
}

TEST_CASE("guided paths: CPU and CUDA agree, and with deterministic=true bits depend on no size of waves") {
    if (!device()) return;
    for (const char* name : {"cornell", "materials", "door"}) {
        INFO(name);
        const Scene scene = project_scene(name, 64, 48);
        const RenderSettings s = guided(scene, 3);
        RenderSettings on_device = s;
        on_device.backend = "cuda";
        const RenderResult one = render_scene(scene, on_device, 16);
        CHECK(one.stats.invalid.total() == 0);
        CHECK(one.stats.memory_bytes == one.stats.memory_bytes_predicted);
        for (const uint32_t wave_size : {1024u, 4096u, 1u << 16}) {
            RenderSettings other = on_device;
            other.wave_size = wave_size;
            check_same_bits(render_scene(scene, other, 16), one);
        }
        on_device.graph = false;
        check_same_bits(render_scene(scene, on_device, 16), one);
    }
}

TEST_CASE("guided bdpt: CPU and CUDA agree with lvc, and training brings nothing to the image") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "materials", "door"}) {
        INFO(name);
        const Scene scene = project_scene(name, 48, 32);
        RenderSettings s = guided(scene, 4), lvc = cpu_settings(scene, Estimator::mis, 5);
        s.integrator = lvc.integrator = "bdpt";
        s.deterministic = false;
        lvc.variant = "lvc";
        lvc.backend = "cuda";
        const Estimate truth = render_batches(scene, lvc, 2048);
        for (const char* sides : {"eye", "both"}) {
            INFO(sides);
            apply_setting(s, "guide_sides", sides);
            s.backend = "cuda";
            const Estimate image = render_batches(scene, s, 2048);
            const ZTestResult z = z_test(image, truth);
            INFO(z.report());
            CHECK(z.pass);
            s.backend = "cpu";
            const ZTestResult on_cpu = z_test(image, render_batches(scene, s, 512));
            INFO(on_cpu.report());
            CHECK(on_cpu.pass);
        }
    }
}
