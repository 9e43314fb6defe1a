// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Where textures and images lie: textures on the host give the same bits in less memory of the device, and images stay
// on the device.
#include "backends/cuda/device_memory.h"
#include "core/error.h"
#include "film/image.h"
#include "tests/support/gpu_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* integrator, TextureMemory textures) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.backend = "cuda";
    s.integrator = integrator;
    s.deterministic = true;  // bits are compared
    s.wave_size = 8192;
    s.textures = textures;
    return s;
}

constexpr TextureMemory kOnHost[] = {TextureMemory::host, TextureMemory::pinned};

}  // namespace

TEST_CASE("textures on the host: the same bits, and as much less memory of the device as they have") {
    if (!device()) return;
    const Scene scene = project_scene("textured", 96, 64);
    REQUIRE(scene.texels.size() > 0);
    for (const char* integrator : {"path", "light", "bdpt"}) {
        const RenderResult there = render_scene(scene, settings_of(scene, integrator, TextureMemory::device), 8);
        for (const TextureMemory memory : kOnHost) {
            CAPTURE(integrator, int(memory));
            const RenderResult here = render_scene(scene, settings_of(scene, integrator, memory), 8);
            CHECK(bool(here.film.sum == there.film.sum));
            CHECK(bool(here.film.sum_squares == there.film.sum_squares));
            CHECK(here.stats.memory_bytes + scene.texels.size() == there.stats.memory_bytes);
            CHECK(here.stats.memory_bytes == here.stats.memory_bytes_predicted);
        }
    }
}

TEST_CASE("textures beyond the device's memory are refused there, and render from the host") {
    if (!device()) return;
    Scene scene = project_scene("textured", 96, 64);
    const RenderResult expected = render_scene(scene, settings_of(scene, "path", TextureMemory::device), 8);
    for (const TextureMemory memory : kOnHost) render_scene(scene, settings_of(scene, "path", memory), 8);
    // Texels that nothing refers to, on a device of which most is taken.
    constexpr uint64_t kTexels = 1 << 30, kLeft = 768 << 20;
    const uint64_t free = free_device_bytes();
    REQUIRE(free > kLeft);
    const DeviceBuffer<std::byte> taken(free - kLeft, "what another program takes");
    scene.texels.resize(scene.texels.size() + kTexels);
    std::string message;
    try {
        render_scene(scene, settings_of(scene, "path", TextureMemory::device), 8);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::device);
        message = e.what();
    }
    INFO(message);
    CHECK(message.find("--textures host") != std::string::npos);
    for (const TextureMemory memory : kOnHost) {
        CAPTURE(int(memory));
        const RenderResult here = render_scene(scene, settings_of(scene, "path", memory), 8);
        CHECK(bool(here.film.sum == expected.film.sum));
    }
}

TEST_CASE("the image on the device has the bits of the film, and outlives the renderer") {
    if (!device()) return;
    const Scene scene = project_scene("textured", 67, 45);
    for (const char* integrator : {"path", "bdpt"}) {
        CAPTURE(integrator);
        const RenderSettings settings = settings_of(scene, integrator, TextureMemory::device);
        std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
        std::vector<float> rgb(67 * 45 * 3, 1.0f);
        const auto bits_of = [&](const DeviceImage& image) {
            REQUIRE(image.width == 67);
            REQUIRE(image.height == 45);
            cuda_check(cudaMemcpy(rgb.data(), image.rgb.get(), rgb.size() * sizeof(float), cudaMemcpyDeviceToHost),
                       "image");
            return rgb;
        };
        CHECK(bool(bits_of(*renderer->device_image()) == std::vector<float>(rgb.size(), 0.0f)));
        REQUIRE(renderer->render(0, 3) == 3);
        const DeviceImage three = *renderer->device_image();
        const Image expected = mean_image(renderer->film());
        CHECK(three.samples == 3);
        REQUIRE(renderer->render(3, 3) == 3);
        CHECK(bool(bits_of(*renderer->device_image()) == mean_image(renderer->film()).rgb));
        renderer.reset();
        CHECK(bool(bits_of(three) == expected.rgb));
    }
    RenderSettings cpu = cpu_settings(scene, Estimator::mis);
    CHECK_FALSE(make_renderer(scene, cpu)->device_image().has_value());
}
