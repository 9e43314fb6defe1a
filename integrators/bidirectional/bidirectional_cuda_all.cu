#include "integrators/bidirectional/bidirectional_cuda.cuh"

namespace ambilux {

std::unique_ptr<Renderer> make_bidirectional_cuda_all(const Scene& scene, const RenderSettings& settings,
                                                      SharedAccels& accels) {
    return std::make_unique<BidirectionalCuda<kAllFeatures>>(scene, settings, accels);
}

}  // namespace ambilux
