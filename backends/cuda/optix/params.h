// What the programs of OptiX read.
#pragma once

#include "backends/handed_rays.h"
#include "scene/view.h"

namespace ambilux {

struct OptixParams {
    SceneView scene;
    HandedRays handed;
    unsigned long long root = 0;  ///< of the structure; 0: there is nothing to meet
    bool opaque = true;           ///< every ray meets every surface
};

/// OptixInstance::instanceId of what is in no instance; those of instances follow.
constexpr uint32_t kOptixTriangles = 0, kOptixQuadrics = 1, kOptixFirstInstance = 2;
/// Hit groups.
constexpr uint32_t kTriangleGroup = 0, kQuadricGroup = 1;

}  // namespace ambilux
