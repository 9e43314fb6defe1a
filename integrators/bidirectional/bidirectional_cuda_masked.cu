#include "integrators/bidirectional/bidirectional_cuda.cuh"

namespace ambilux {

std::unique_ptr<Renderer> make_bidirectional_cuda_masked(const Scene& scene, const RenderSettings& settings,
                                                         SharedAccels& accels) {
    return std::make_unique<BidirectionalCuda<kMaskedFeatures>>(scene, settings, accels);
}

}  // namespace ambilux
