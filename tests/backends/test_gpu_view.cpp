// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// What `ambilux view` asks of a renderer on a CUDA device: another camera without another renderer, pictures of 8 bits.
#include "tests/support/gpu_device.h"
#include "tests/support/moved_camera.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const char* integrator, const char* variant) {
    RenderSettings s;
    s.backend = "cuda";
    s.integrator = integrator;
    s.variant = variant;
    s.deterministic = s.variant != "lvc";
    return s;
}

}  // namespace

TEST_CASE("a renderer on a device whose camera moved is one that was made there") {
    if (!device()) return;
    for (const auto& [integrator, variant] : {std::pair{"path", "wavefront"},
                                              {"light", "wavefront"},
                                              {"bdpt", "wavefront"},
                                              {"bdpt", "streaming"},
                                              {"bdpt", "lvc"}})
        for (const bool graph : {true, false}) {
            INFO(integrator << " " << variant << " graph=" << graph);
            Scene scene = project_scene("glass", 128, 96);
            RenderSettings s = settings_of(integrator, variant);
            s.graph = graph;
            const MovedCamera m = move_camera(scene, s);
            REQUIRE(m.moved);
            CHECK(m.film.samples == 4);
            CHECK(m.stats.samples == 4);
            CHECK(m.stats.memory_bytes == m.of_new_stats.memory_bytes);
            if (!s.deterministic) {
                CHECK(relative_difference(m.film, m.of_a_new_one) < 0.5);
                continue;
            }
            CHECK(m.film.sum == m.of_a_new_one.sum);
            CHECK(m.stats.rays_extend == m.of_new_stats.rays_extend);
            CHECK(m.stats.rays_occlude == m.of_new_stats.rays_occlude);
        }
}

TEST_CASE("pictures of a device are the image in 8 bits of sRGB, and stay while they are held") {
    if (!device()) return;
    for (const auto& [width, height] : {std::pair(33u, 21u), {128u, 96u}, {1u, 1u}}) {
        const Scene scene = project_scene("glass", width, height);
        const auto renderer = make_renderer(scene, settings_of("path", "wavefront"));
        check_picture(*renderer, 0);
        renderer->render(0, 4);
        const ByteImage held = renderer->picture(0);
        const std::vector<uint8_t> bytes(held.rgb.get(), held.rgb.get() + held.bytes());
        for (const float stops : {0.0f, 2.5f, -3.0f}) check_picture(*renderer, stops);
        CHECK(std::equal(bytes.begin(), bytes.end(), held.rgb.get()));
    }
}
