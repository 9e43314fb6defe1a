// The unidirectional path tracer on either backend.
#pragma once

#include "accel/shared_accels.h"
#include "render/renderer.h"

namespace ambilux {

/// CPU: stages over small waves, one per task, so that a wave stays in a core's cache; rays by Embree, or by the host
/// build of the CUDA traversal.
std::unique_ptr<Renderer> make_path_cpu(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

/// CUDA: one large wave on the device. Throws Error(device) without a CUDA build or a device.
std::unique_ptr<Renderer> make_path_cuda(const Scene& scene, const RenderSettings& settings, SharedAccels& accels);

}  // namespace ambilux
