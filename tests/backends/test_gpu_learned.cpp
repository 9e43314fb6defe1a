// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// timeout: 600
// Variant learned of bdpt on a CUDA device.
#include "tests/support/bidirectional_images.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* variant, const char* backend, uint64_t seed) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.integrator = "bdpt";
    s.variant = variant;
    s.backend = backend;
    return s;
}

}  // namespace

TEST_CASE("learned draws of a device have the expectation of uniform ones, and of those of the CPU") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured"}) {
        INFO(name);
        const Scene scene = project_scene(name, 48, 32);
        const auto render = [&](const char* variant, const char* backend, uint64_t seed) {
            RenderSettings s = settings_of(scene, variant, backend, seed);
            if (name == std::string("glass")) apply_setting(s, "strategies", "next_event+connections+light");
            return render_batches(scene, s, 512);
        };
        const Estimate uniform = render("lvc", "cuda", 1), learned = render("learned", "cuda", 2),
                       host = render("learned", "cpu", 3);
        for (const Estimate* other : {&uniform, &host}) {
            const ZTestResult z = z_test(learned, *other);
            INFO(z.report());
            CHECK(z.pass);
        }
    }
}

TEST_CASE("learned draws of a device over queues in any order, with and without a graph, in memory as predicted") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 48, 32);
    const Estimate paired = render_batches(scene, settings_of(scene, "wavefront", "cuda", 1), 1024);
    for (const auto& [compaction, ordering, graph, draws] : {std::tuple{"atomic", "material", true, 1u},
                                                             {"select", "none", true, 3u},
                                                             {"none", "morton", true, 8u},
                                                             {"atomic", "none", false, 3u}}) {
        RenderSettings s = settings_of(scene, "learned", "cuda", 7);
        apply_setting(s, "compaction", compaction);
        apply_setting(s, "ordering", ordering);
        s.graph = graph;
        s.connections = draws;
        INFO("compaction=" << compaction << " ordering=" << ordering << " graph=" << graph << " draws " << draws);
        const ZTestResult z = z_test(render_batches(scene, s, 1024), paired);
        INFO(z.report());
        CHECK(z.pass);
        const RenderResult r = render_scene(scene, s, 8);
        CHECK(r.stats.invalid.total() == 0);
        CHECK(r.stats.memory_bytes == r.stats.memory_bytes_predicted);
        for (const QueueStats& q : r.stats.queues) CHECK(q.overflow == 0);
    }
}
