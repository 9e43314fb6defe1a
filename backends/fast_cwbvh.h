// The wide BVH by fast steps (fast_build.h), on the host.
#pragma once

#include "accel/cwbvh.h"

namespace ambilux {

/// Throws Error(device) if the tree is deeper than the traversal stack, Error(usage) of a scene with groups.
CwbvhArrays build_cwbvh_fast(const SceneView& scene);

}  // namespace ambilux
