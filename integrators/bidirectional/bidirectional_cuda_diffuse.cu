#include "integrators/bidirectional/bidirectional_cuda.cuh"

namespace ambilux {

std::unique_ptr<Renderer> make_bidirectional_cuda_diffuse(const Scene& scene, const RenderSettings& settings,
                                                          SharedAccels& accels) {
    return std::make_unique<BidirectionalCuda<kDiffuseFeatures>>(scene, settings, accels);
}

}  // namespace ambilux
