// One translation unit per level of features, so that they compile side by side.
#pragma once

#include "accel/shared_accels.h"
#include "render/renderer.h"

namespace ambilux {

std::unique_ptr<Renderer> make_bidirectional_cuda_diffuse(const Scene& scene, const RenderSettings& settings,
                                                          SharedAccels& accels);
std::unique_ptr<Renderer> make_bidirectional_cuda_untextured(const Scene& scene, const RenderSettings& settings,
                                                             SharedAccels& accels);
std::unique_ptr<Renderer> make_bidirectional_cuda_triangles(const Scene& scene, const RenderSettings& settings,
                                                            SharedAccels& accels);
std::unique_ptr<Renderer> make_bidirectional_cuda_masked(const Scene& scene, const RenderSettings& settings,
                                                         SharedAccels& accels);
std::unique_ptr<Renderer> make_bidirectional_cuda_all(const Scene& scene, const RenderSettings& settings,
                                                      SharedAccels& accels);

}  // namespace ambilux
