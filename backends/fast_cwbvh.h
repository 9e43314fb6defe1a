// The wide BVH by fast steps (fast_build.h), of scenes without groups: others' trees have two levels, and only the good
// builder makes these.
#pragma once

#include "accel/cwbvh.h"
#include "accel/shared_accels.h"

namespace ambilux {

/// Throws Error(usage) of a scene with groups, Error(device) if the tree is deeper than the traversal stack.
CwbvhArrays build_cwbvh_fast(const SceneView& scene);

/// The structure over a scene, built on the host: what a device builds, to the bit.
class FastCwbvhAccel : public CwbvhAccel {
public:
    explicit FastCwbvhAccel(const Scene& scene);
};

template <>
std::shared_ptr<const FastCwbvhAccel> SharedAccels::get<FastCwbvhAccel>();

/// What a device has built, with the most bytes that it needed, and how long it took once its kernels were loaded.
struct FastOnDevice {
    CwbvhArrays arrays;
    double seconds;
    uint64_t peak_bytes;
};
/// Throws Error(device) without a device.
FastOnDevice build_cwbvh_fast_on_device(const Scene& scene);

}  // namespace ambilux
