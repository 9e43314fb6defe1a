// OptiX of NVIDIA's driver as a tracer: a structure over a scene, and launches over rays that are handed over. Nothing
// of its headers is needed here. In a build without them (backends/optix.h) all of this throws.
#pragma once

#include <cuda_runtime_api.h>

#include <memory>

#include "backends/handed_rays.h"
#include "backends/optix.h"
#include "scene/scene.h"

namespace ambilux {

/// One for each renderer, on the device that is current. Launches of one follow each other on one stream.
class DeviceOptix {
public:
    /// `on_device`: the view of the copy of `scene` there, which must outlive this object. Throws Error(device) without
    /// the driver's library, where it does not know the interface, and where building needs more than `room` bytes.
    DeviceOptix(const Scene& scene, const SceneView& on_device, uint64_t room);
    ~DeviceOptix();
    DeviceOptix(const DeviceOptix&) = delete;
    DeviceOptix& operator=(const DeviceOptix&) = delete;

    /// Where rays are handed over from now on. It launches once over none, so that what the driver allocates for
    /// launches is there. Waits.
    void take(const HandedRays& handed, cudaStream_t stream);
    /// Follows the rays of the run that was handed over: to their nearest hits, or until anything blocks them. Not
    /// while a graph is captured: in a conditional node such a launch is an illegal access.
    void trace(bool any_hit, cudaStream_t stream) const;
    const OptixFacts& facts() const { return facts_; }

private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
    OptixFacts facts_;
};

}  // namespace ambilux
