// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// wraps: cudaMalloc cudaMallocManaged cudaFree
// The setting memory on a CUDA device: what is allocated there stays below it, and the image is the same.
#include <map>
#include <mutex>

#include "backends/cuda/device_memory.h"
#include "core/error.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/caught_subpaths.h"
#include "tests/support/gpu_device.h"

using namespace ambilux;

namespace {

/// What cudaMalloc gave and cudaFree did not take back, and the most of it.
struct DeviceBytes {
    std::mutex mutex;
    std::map<void*, size_t> blocks;
    uint64_t held = 0, most = 0;

    cudaError_t add(cudaError_t error, void* block, size_t size) {
        if (error != cudaSuccess) return error;
        const std::lock_guard<std::mutex> lock(mutex);
        blocks[block] = size;
        held += size;
        most = std::max(most, held);
        return error;
    }
    void remove(void* block) {
        const std::lock_guard<std::mutex> lock(mutex);
        const auto at = blocks.find(block);
        if (at == blocks.end()) return;
        held -= at->second;
        blocks.erase(at);
    }
} device_bytes;

}  // namespace

extern "C" {
cudaError_t __real_cudaMalloc(void** p, size_t n);
cudaError_t __real_cudaMallocManaged(void** p, size_t n, unsigned int flags);
cudaError_t __real_cudaFree(void* p);
cudaError_t __wrap_cudaMalloc(void** p, size_t n) {
    const cudaError_t error = __real_cudaMalloc(p, n);
    return device_bytes.add(error, error == cudaSuccess ? *p : nullptr, n);
}
cudaError_t __wrap_cudaMallocManaged(void** p, size_t n, unsigned int flags) {
    return __real_cudaMallocManaged(p, n, flags);  // of the host
}
cudaError_t __wrap_cudaFree(void* p) {
    device_bytes.remove(p);
    return __real_cudaFree(p);
}
}

namespace {

/// All but the tutorials'.
constexpr std::pair<const char*, const char*> kVariants[] = {
    {"path", "wavefront"}, {"light", "wavefront"}, {"bdpt", "wavefront"}, {"bdpt", "lvc"},
    {"bdpt", "learned"},   {"bdpt", "streaming"},  {"bdpt", "megakernel"}};

RenderSettings settings_of(const Scene& scene, const char* integrator, const char* variant) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.backend = "cuda";
    s.integrator = integrator;
    s.variant = variant;
    return s;
}

/// All that a renderer does, within its budget by its own count and by that of cudaMalloc.
RenderResult render_counted(const Scene& scene, const RenderSettings& s, uint32_t spp) {
    const uint64_t before = device_bytes.held;
    device_bytes.most = before;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    REQUIRE(renderer->render(0, spp) == spp);
    REQUIRE(renderer->device_image().has_value());
    const FilmMoments film = renderer->take_film()();
    const RenderStats stats = renderer->stats();
    CHECK(stats.memory_bytes == stats.memory_bytes_predicted);
    CHECK(device_bytes.most - before == stats.memory_bytes_peak);
    if (s.memory) CHECK(device_bytes.most - before <= s.memory);
    CHECK(stats.invalid.total() == 0);
    for (const QueueStats& q : stats.queues) CHECK(q.overflow == 0);
    return {film, stats};
}

/// Little more than the least budget.
uint64_t small_budget(const Scene& scene, RenderSettings s) {
    s.wave_size = 1024;
    s.memory = uint64_t(1) << 40;
    const uint64_t whole = make_renderer(scene, s)->stats().memory_bytes_predicted;
    for (s.memory = whole, s.wave_size = 0;; s.memory -= s.memory / 4) {
        try {
            make_renderer(scene, s);
        } catch (const Error& e) {
            CHECK(e.code == ExitCode::device);
            CHECK(std::string(e.what()).find("at least") != std::string::npos);
            return s.memory + s.memory / 3 + 2;
        }
    }
}

}  // namespace

TEST_CASE("1920x1080 within 256 MiB, 1 GiB and 4 GiB, of all integrators and variants on a device") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 1920, 1080);
    for (const auto& [integrator, variant] : kVariants)
        for (const char* memory : {"256M", "1G", "4G"}) {
            CAPTURE(integrator, variant, memory);
            RenderSettings s = settings_of(scene, integrator, variant);
            apply_setting(s, "memory", memory);
            render_counted(scene, s, 2);
        }
    RenderSettings tight = settings_of(scene, "bdpt", "lvc");
    apply_setting(tight, "memory", "128M");
    CHECK_THROWS_AS(make_renderer(scene, tight), Error);
}

TEST_CASE("parts of the film make the image of the whole: the same bits where they repeat") {
    if (!device()) return;
    for (const char* name : {"materials", "glass"}) {
        const Scene scene = project_scene(name, 250, 141);  // tiles at two sides are cut
        for (const auto& [integrator, variant] : {std::pair{"path", "wavefront"},
                                                  {"light", "wavefront"},
                                                  {"bdpt", "wavefront"},
                                                  {"bdpt", "megakernel"},
                                                  {"bdpt", "streaming"}})
            for (const bool graph : {true, false}) {
                CAPTURE(name, integrator, variant, graph);
                RenderSettings s = settings_of(scene, integrator, variant);
                s.deterministic = true;
                s.graph = graph;
                s.expected_samples = 3;
                if (s.integrator == "light") apply_setting(s, "light_paths", "2.5");
                const RenderResult whole = render_counted(scene, s, 3);
                s.memory = small_budget(scene, s) + (4 << 20);  // for some thousand paths at once
                const RenderResult parts = render_counted(scene, s, 3);
                CHECK(parts.stats.memory_bytes < whole.stats.memory_bytes);
                CHECK(parts.stats.rays_extend == whole.stats.rays_extend);
                CHECK(parts.stats.rays_occlude == whole.stats.rays_occlude);
                CHECK(bool(parts.film.sum == whole.film.sum));
                CHECK(bool(parts.film.sum_squares == whole.film.sum_squares));
            }
    }
}

TEST_CASE("parts of the film have the expectation of the whole") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 96, 64);
    RenderSettings reference = settings_of(scene, "bdpt", "wavefront");
    reference.seed = 5;
    const Estimate expected = render_batches(scene, reference, 256);
    for (const char* variant : {"wavefront", "lvc", "learned", "streaming", "megakernel"}) {
        RenderSettings s = settings_of(scene, "bdpt", variant);
        s.memory = small_budget(scene, s) + (2 << 20);
        const ZTestResult result = z_test(render_batches(scene, s, 256), expected);
        INFO(variant << "\n" << result.report());
        CHECK(result.pass);
    }
}

TEST_CASE(
    "a part of the film with more light vertices than were planned for is done again, in smaller parts if need be") {
    if (!device()) return;
    const Scene scene = scene_of_caught_subpaths();
    RenderSettings s = settings_of(scene, "bdpt", "wavefront");
    s.deterministic = true;
    s.max_depth = 200;
    s.rr_depth = -1;
    s.expected_samples = 8;
    const RenderResult whole = render_counted(scene, s, 8);
    s.memory = small_budget(scene, s) + (1 << 20);
    const uint64_t planned = make_renderer(scene, s)->stats().memory_bytes_predicted;
    const RenderResult parts = render_counted(scene, s, 8);
    CHECK(parts.stats.memory_bytes_predicted != planned);  // waves were planned anew
    CHECK(bool(parts.film.sum == whole.film.sum));
    CHECK(bool(parts.film.sum_squares == whole.film.sum_squares));
}

TEST_CASE("images of single strategies and a selection keep to the budget") {
    if (!device()) return;
    const Scene scene = project_scene("materials", 160, 90);
    RenderSettings s = settings_of(scene, "bdpt", "wavefront");
    s.technique_depth = 4;
    s.memory = uint64_t(64) << 20;
    render_counted(scene, s, 2);
    s.technique_depth = 0;
    s.automatic = true;
    s.expected_seconds = 0.2;
    device_bytes.most = device_bytes.held;
    const uint64_t before = device_bytes.held;
    const std::unique_ptr<Renderer> chosen = make_renderer(scene, s);
    chosen->render(0, 4);
    CHECK(device_bytes.most - before <= s.memory);
}
