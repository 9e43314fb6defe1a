#include "backends/cuda_device.h"
#include "core/error.h"
#include "integrators/bidirectional/bidirectional.h"
#include "render/feature_levels.h"
#if defined(AMBILUX_HAS_CUDA)
#include "integrators/bidirectional/bidirectional_cuda.h"
#endif

namespace ambilux {

std::unique_ptr<Renderer> make_bidirectional_cuda([[maybe_unused]] const Scene& scene,
                                                  [[maybe_unused]] const RenderSettings& settings,
                                                  [[maybe_unused]] SharedAccels& accels) {
#if defined(AMBILUX_HAS_CUDA)
    if (!cuda_device_present())
        throw Error(ExitCode::device, "no CUDA device answers: check the driver with nvidia-smi, or use --backend cpu");
    return with_kernel_level(scene.features, settings.specialise, [&](auto level) {
        if constexpr (decltype(level)::value == kDiffuseFeatures)
            return make_bidirectional_cuda_diffuse(scene, settings, accels);
        else if constexpr (decltype(level)::value == kUntexturedFeatures)
            return make_bidirectional_cuda_untextured(scene, settings, accels);
        else if constexpr (decltype(level)::value == kTriangleFeatures)
            return make_bidirectional_cuda_triangles(scene, settings, accels);
        else if constexpr (decltype(level)::value == kMaskedFeatures)
            return make_bidirectional_cuda_masked(scene, settings, accels);
        else
            return make_bidirectional_cuda_all(scene, settings, accels);
    });
#else
    throw Error(ExitCode::device,
                "this program was built without CUDA: install the CUDA toolkit and build again, or use --backend cpu");
#endif
}

}  // namespace ambilux
