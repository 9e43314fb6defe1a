#include "integrators/path/path_cuda.cuh"

namespace ambilux {

std::unique_ptr<Renderer> make_path_cuda_all(const Scene& scene, const RenderSettings& settings, SharedAccels& accels) {
    return std::make_unique<PathCuda<kAllFeatures>>(scene, settings, accels);
}

}  // namespace ambilux
