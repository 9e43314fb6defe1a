// One translation unit per level of features, so that they compile side by side.
#pragma once

#include "integrators/renderer.h"

namespace ambilux {

std::unique_ptr<Renderer> make_bidirectional_cuda_diffuse(const Scene& scene, const RenderSettings& settings);
std::unique_ptr<Renderer> make_bidirectional_cuda_triangles(const Scene& scene, const RenderSettings& settings);
std::unique_ptr<Renderer> make_bidirectional_cuda_all(const Scene& scene, const RenderSettings& settings);

}  // namespace ambilux
