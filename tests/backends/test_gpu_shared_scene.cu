// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// What renderers of one scene share on a device, and choices that are made there.
#include "accel/shared_accels.h"
#include "backends/cuda/device_scene.h"
#include "render/shared_renderer.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

namespace {

RenderSettings fixed_settings(const Scene& scene, const char* integrator) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.backend = "cuda";
    s.integrator = integrator;
    s.queues.ordering = Ordering::none;
    s.deterministic = true;  // bits are compared
    return s;
}

}  // namespace

TEST_CASE("renderers of one scene share its copy on the device, which lives as long as any of them") {
    if (!device()) return;
    const Scene scene = project_scene("textured", 64, 48);
    const RenderSettings path = fixed_settings(scene, "path"), light = fixed_settings(scene, "light");
    std::unique_ptr<Renderer> a, b;
    std::weak_ptr<const DeviceScene> copy;
    std::weak_ptr<const DeviceCwbvh> structure;
    {
        SharedAccels accels(scene);
        a = make_renderer(scene, path, accels);
        b = make_renderer(scene, light, accels);
        copy = accels.get<DeviceScene>();
        structure = accels.get<DeviceCwbvh>();
        CHECK(accels.get<DeviceScene>() == copy.lock());
        CHECK(copy.use_count() == 3);
        CHECK(structure.use_count() == 3);
    }
    CHECK(copy.use_count() == 2);
    const auto check = [&](Renderer& shared, const RenderSettings& settings) {
        REQUIRE(shared.render(0, 4) == 4);
        const RenderResult own = render_scene(scene, settings, 4);
        CHECK(shared.film().sum == own.film.sum);
        CHECK(shared.stats().memory_bytes == own.stats.memory_bytes);
        CHECK(shared.stats().memory_bytes == shared.stats().memory_bytes_predicted);
    };
    check(*b, light);
    b.reset();
    check(*a, path);
    CHECK(copy.use_count() == 1);
    CHECK(structure.use_count() == 1);
    a.reset();
    CHECK(copy.expired());
    CHECK(structure.expired());
}

TEST_CASE("what is chosen on a device renders as if its settings had been given, in as much memory") {
    if (!device()) return;
    for (const char* name : {"cornell", "glass", "lights", "materials"}) {
        const Scene scene = project_scene(name, 96, 64);
        RenderSettings s = cpu_settings(scene, Estimator::mis, 5);
        s.backend = "cuda";
        s.integrator = "bdpt";
        s.automatic = true;
        const RenderResult chosen = render_scene(scene, s, 4);
        const SelectionStats& selection = chosen.stats.selection;
        INFO(name << ": " << selection.name);
        REQUIRE_FALSE(selection.name.empty());
        for (const SelectionStats::Candidate& c : selection.candidates)
            CHECK(c.seconds == 0);  // their work tells more than short waves would
        s.automatic = false;
        for (const auto& [key, value] : selection.settings) apply_setting(s, key, value);
        const RenderResult again = render_scene(scene, s, 4);
        CHECK(again.stats.rays_extend == chosen.stats.rays_extend);
        CHECK(again.stats.memory_bytes == chosen.stats.memory_bytes);
        CHECK(chosen.stats.memory_bytes == chosen.stats.memory_bytes_predicted);
        // A cache of light vertices has another order in every run.
        if (s.variant != "lvc") CHECK(worst_difference(again.film, mean_image(chosen.film)) < 1e-5);
    }
}

TEST_CASE("a path tracer that renders while the pilot runs is the render that was asked for") {
    if (!device()) return;
    // A sky over diffuse ground is the path tracer's.
    const Scene scene = scene_from_text(scene_xml(
        4, "<sensor type='perspective'><float name='fov' value='45'/>" +
               lookat("origin='0,-3,2.5' target='0,0,0.3' up='0,0,1'") + film(64) + "</sensor>" +
               "<shape type='rectangle'>" + diffuse({0.5f, 0.5f, 0.5f}) + "</shape><emitter type='constant'/>"));
    RenderSettings s = cpu_settings(scene, Estimator::mis, 5);
    s.backend = "cuda";
    s.integrator = "bdpt";
    s.automatic = true;
    s.expected_seconds = 1;
    const auto renderer = make_renderer(scene, s);
    REQUIRE(renderer->stats().selection.name == "path");
    const uint32_t ready = renderer->ready();
    REQUIRE(ready > 0);
    RenderSettings path = s;
    path.automatic = false;
    for (const auto& [key, value] : renderer->stats().selection.settings) apply_setting(path, key, value);
    REQUIRE(renderer->render(0, ready + 3) == ready + 3);
    CHECK(renderer->film().samples == ready + 3);
    CHECK(renderer->ready() == 0);
    CHECK(worst_difference(render_scene(scene, path, ready + 3).film, mean_image(renderer->film())) < 1e-5);
    // Fewer, or others, are rendered as if nothing had been.
    const auto fewer = make_renderer(scene, s);
    const uint32_t most = fewer->ready() - 1;
    REQUIRE(fewer->render(0, most) == most);
    CHECK(fewer->film().samples == most);
    if (most > 0) CHECK(worst_difference(render_scene(scene, path, most).film, mean_image(fewer->film())) < 1e-5);
    const auto later = make_renderer(scene, s);
    REQUIRE(later->render(5, 2) == 2);
    CHECK(later->film().samples == 2);
}
