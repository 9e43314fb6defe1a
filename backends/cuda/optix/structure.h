// OptiX's structure over a scene: a tree over the triangles that are in no group, one over all analytic shapes, one for
// each group, and one over these and instances unless the first is all there is.
#pragma once

#include <vector>

#include "backends/cuda/device_memory.h"
#include "backends/cuda/optix/context.h"
#include "scene/scene.h"

namespace ambilux {

struct OptixStructure {
    OptixTraversableHandle root = 0;  ///< 0: the scene is empty
    bool two_levels = false;
    std::vector<DeviceBuffer<std::byte>> trees;
    uint64_t bytes = 0;
    uint64_t peak_bytes = 0, predicted_peak_bytes = 0;  ///< while it was built
};

/// `on_device`: the view of a copy of `scene`, which it need not outlive. Throws Error(device) before anything is
/// allocated if more than `room` bytes would be needed.
OptixStructure build_optix_structure(const OptixContext& optix, const Scene& scene, const SceneView& on_device,
                                     uint64_t room);

}  // namespace ambilux
