// libs: ambilux_render ambilux_integrators ambilux_backends ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 300
// Instances on a CUDA device: the hits of the same traversal on the host, and the image of copies.
#include <cmath>

#include "accel/cwbvh.h"
#include "backends/trace_on_device.h"
#include "scene/flatten.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/gpu_device.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using namespace ambilux::accel_test;

TEST_CASE("rays on a device meet instances as on the host, with holes and without") {
    if (!device()) return;
    const std::vector<Ray> rays = test::rays_around(100000, 5);
    for (const char* bsdf : {"<bsdf type='diffuse'/>", test::kMaskBsdf}) {
        const Scene scene = test::load_forest(bsdf);
        const SceneView view = scene.view();
        const CwbvhAccel accel(scene);
        for (const bool persistent : {false, true}) {
            const std::vector<Hit> hits = trace_on_device(scene, rays, false, persistent, false),
                                   blocked = trace_on_device(scene, rays, true, persistent, false);
            uint32_t different = 0, other_answer = 0, instanced = 0;
            for (size_t i = 0; i < rays.size(); ++i) {
                Hit hit;
                accel.tracer().closest<kAllFeatures>(view, rays[i], hit);
                if (hit.prim != kNone) instanced += view.is_instanced(hit.prim);
                different += hit.prim != hits[i].prim ||
                             (hit.prim != kNone && std::fabs(hit.t - hits[i].t) > 1e-5f * (1 + hit.t));
                other_answer += (hit.prim != kNone) != (blocked[i].prim != kNone);
            }
            CAPTURE(bsdf, persistent, different, other_answer, instanced);
            CHECK(instanced > rays.size() / 20);
            // The host's compiler fuses other sums of products where rays are moved into groups.
            CHECK(different <= rays.size() / 2000);
            CHECK(other_answer <= rays.size() / 2000);
        }
    }
}

TEST_CASE("images of instances on a device are those of copies and of the CPU") {
    if (!device()) return;
    const Scene scene = test::load_forest("<bsdf type='diffuse'/>"), copy = flatten_instances(scene);
    for (const char* integrator : {"path", "bdpt"}) {
        const auto render = [&](const Scene& s, const char* backend) {
            RenderSettings settings = cpu_settings(s, Estimator::mis);
            settings.backend = backend;
            settings.integrator = integrator;
            return render_scene(s, settings, 16).film;
        };
        const FilmMoments shared = render(scene, "cuda"), copied = render(copy, "cuda"), host = render(scene, "cpu");
        const auto check = [&](const FilmMoments& a, const FilmMoments& b) {
            double sum = 0, other = 0;
            size_t close = 0;
            for (size_t i = 0; i < a.sum.size(); ++i) {
                sum += a.sum[i], other += b.sum[i];
                close += std::fabs(a.sum[i] - b.sum[i]) <= 1e-2 * (std::fabs(b.sum[i]) + 0.05);
            }
            CAPTURE(integrator, sum, other, close, a.sum.size());
            CHECK(sum == Approx(other).epsilon(0.01));
            CHECK(close >= a.sum.size() * 8 / 10);
        };
        check(shared, copied);
        check(shared, host);
    }
}
