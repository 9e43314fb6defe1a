// What several renderers of one scene have in common: acceleration structures, and copies on a device.
#pragma once

#include <memory>
#include <mutex>

#include "scene/scene.h"

namespace ambilux {

class CwbvhAccel;
class EmbreeAccel;
class DeviceScene;
class DeviceCwbvh;

/// Each is made when it is first asked for, by whichever thread, and lives as long as this object or a renderer that
/// holds it. The scene must not change meanwhile and must outlive them.
class SharedAccels {
public:
    explicit SharedAccels(const Scene& scene) : scene_(scene) {}

    /// `T`: CwbvhAccel, EmbreeAccel; in builds with CUDA also DeviceScene, DeviceCwbvh (backends/cuda/device_scene.h).
    template <class T>
    std::shared_ptr<const T> get();

private:
    /// Returns `made`, after make() if it is not yet.
    template <class T>
    std::shared_ptr<const T> once(std::shared_ptr<const T>& made, auto make) {
        const std::lock_guard<std::recursive_mutex> lock(mutex_);
        if (!made) made = make();
        return made;
    }

    const Scene& scene_;
    std::recursive_mutex mutex_;  ///< some are made from others
    std::shared_ptr<const CwbvhAccel> cwbvh_;
    std::shared_ptr<const EmbreeAccel> embree_;
    std::shared_ptr<const DeviceScene> device_scene_;
    std::shared_ptr<const DeviceCwbvh> device_cwbvh_;
};

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get<CwbvhAccel>();
template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get<EmbreeAccel>();

}  // namespace ambilux
