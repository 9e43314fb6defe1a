// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// wraps: cudaLaunchKernel __cudaLaunchKernel cudaGraphLaunch cudaMemcpy cudaMemcpyAsync cudaMemset cudaMemsetAsync
// wraps: cudaStreamSynchronize cudaDeviceSynchronize cudaEventSynchronize cudaMalloc cudaMemGetInfo
// G6: what the host does while a device renders, counted at CUDA's functions, which the linker leads through this file.
#include <cuda_runtime.h>

#include "tests/support/gpu_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

struct Calls {
    int launches = 0, graphs = 0, copies = 0, waits = 0, allocations = 0;
} calls;

}  // namespace

#define AMBILUX_COUNTED(name, count, parameters, arguments) \
    cudaError_t __real_##name parameters;                   \
    cudaError_t __wrap_##name parameters {                  \
        ++calls.count;                                      \
        return __real_##name arguments;                     \
    }

extern "C" {
AMBILUX_COUNTED(cudaLaunchKernel, launches, (const void* f, dim3 g, dim3 b, void** a, size_t n, cudaStream_t s),
                (f, g, b, a, n, s))
#if CUDART_VERSION >= 13000
AMBILUX_COUNTED(__cudaLaunchKernel, launches, (cudaKernel_t f, dim3 g, dim3 b, void** a, size_t n, cudaStream_t s),
                (f, g, b, a, n, s))
#endif
AMBILUX_COUNTED(cudaGraphLaunch, graphs, (cudaGraphExec_t g, cudaStream_t s), (g, s))
AMBILUX_COUNTED(cudaMemcpy, copies, (void* to, const void* from, size_t n, cudaMemcpyKind k), (to, from, n, k))
AMBILUX_COUNTED(cudaMemcpyAsync, copies, (void* to, const void* from, size_t n, cudaMemcpyKind k, cudaStream_t s),
                (to, from, n, k, s))
AMBILUX_COUNTED(cudaMemset, copies, (void* to, int v, size_t n), (to, v, n))
AMBILUX_COUNTED(cudaMemsetAsync, copies, (void* to, int v, size_t n, cudaStream_t s), (to, v, n, s))
AMBILUX_COUNTED(cudaStreamSynchronize, waits, (cudaStream_t s), (s))
AMBILUX_COUNTED(cudaDeviceSynchronize, waits, (), ())
AMBILUX_COUNTED(cudaEventSynchronize, waits, (cudaEvent_t e), (e))
AMBILUX_COUNTED(cudaMalloc, allocations, (void** p, size_t n), (p, n))
AMBILUX_COUNTED(cudaMemGetInfo, allocations, (size_t* f, size_t* t), (f, t))
}

namespace {

constexpr uint32_t kSamples = 8;

/// What kSamples samples take, once a first one has told how long they take and how much memory.
Calls calls_of(const Scene& scene, const RenderSettings& settings) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    REQUIRE(renderer->render(0, 1) == 1);
    calls = {};
    REQUIRE(renderer->render(1, kSamples) == kSamples);
    return calls;
}

RenderSettings settings_of(const Scene& scene, const char* integrator, const char* variant, int max_depth) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.backend = "cuda";
    s.integrator = integrator;
    s.variant = variant;
    s.max_depth = max_depth;
    s.rr_depth = 1000;  // paths as long as they may be
    s.wave_size = 4096;
    return s;
}

}  // namespace

TEST_CASE("G6: a wave takes two launches, a pass one wait and at most one copy, whatever the depth") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 64, 64);
    for (const auto& [integrator, variant] : {std::pair{"path", "wavefront"},
                                              {"light", "wavefront"},
                                              {"bdpt", "wavefront"},
                                              {"bdpt", "lvc"},
                                              {"bdpt", "megakernel"},
                                              {"bdpt", "streaming"}})
        for (const int max_depth : {2, 5, 16}) {
            INFO(integrator << " " << variant << ", depth " << max_depth);
            const Calls c = calls_of(scene, settings_of(scene, integrator, variant, max_depth));
            CHECK(c.graphs >= 1);
            CHECK(c.graphs <= int(kSamples));
            CHECK(c.launches == c.graphs);  // the kernel that says which wave it is
            CHECK(c.waits >= 1);
            CHECK(c.waits <= 2);
            CHECK(c.copies <= c.waits);  // the state of the wave, where it may have had too little memory
            CHECK(c.allocations == 0);
        }
}

TEST_CASE("G6: kernel by kernel, for profilers, the host reads sizes of queues; the count would see that") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 64, 64);
    const auto single = [&](int max_depth) {
        RenderSettings s = settings_of(scene, "path", "wavefront", max_depth);
        s.graph = false;
        return calls_of(scene, s);
    };
    const Calls few = single(2), many = single(16);
    CHECK(few.graphs == 0);
    CHECK(few.launches > 5 * int(kSamples));
    CHECK(many.launches > 3 * few.launches);
    CHECK(many.copies > few.copies + 4 * int(kSamples));
    CHECK(many.waits > few.waits + 4 * int(kSamples));
}
