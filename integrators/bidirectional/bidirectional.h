// Light tracing and bidirectional path tracing on either backend.
#pragma once

#include "accel/shared_accels.h"
#include "render/renderer.h"

namespace ambilux {

/// CPU: small waves of paired walks, one per task. All tasks of a sample add their splats to one film in fixed point.
std::unique_ptr<Renderer> make_bidirectional_cpu(const Scene& scene, const RenderSettings& settings,
                                                 SharedAccels& accels);

/// CUDA: one wave over the whole film. Throws Error(device) without a CUDA build or a device.
std::unique_ptr<Renderer> make_bidirectional_cuda(const Scene& scene, const RenderSettings& settings,
                                                  SharedAccels& accels);

}  // namespace ambilux
