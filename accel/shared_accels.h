// What several renderers of one scene have in common: acceleration structures, and copies on a device.
#pragma once

#include <memory>
#include <mutex>

#include "scene/scene.h"
#include "scene/texture_memory.h"

namespace ambilux {

class CwbvhAccel;
class EmbreeAccel;
class Faces;
class LightTree;
class DeviceScene;
class DeviceCwbvh;
class DeviceLightTree;
class HostTexels;

/// What follows from the shapes of a scene, and from which of them let rays pass: scenes that have these in common may
/// share it.
struct Structures {
    std::recursive_mutex mutex;
    std::shared_ptr<const CwbvhAccel> cwbvh;
    std::shared_ptr<const EmbreeAccel> embree;
    std::shared_ptr<const Faces> faces;
};

/// Whether structures of the one serve the other.
bool same_structure(const Scene& a, const Scene& b);

/// Each is made when it is first asked for, by whichever thread, and lives as long as this object or a renderer that
/// holds it. The scene must not change meanwhile and must outlive them.
class SharedAccels {
public:
    explicit SharedAccels(const Scene& scene, std::shared_ptr<Structures> structures = std::make_shared<Structures>())
        : scene_(scene), structures_(std::move(structures)) {}
    /// For one of several devices: what lies on the host is that of `host`, which must outlive this object.
    SharedAccels(const Scene& scene, SharedAccels& host) : scene_(scene), host_(&host), structures_(host.structures_) {}

    /// Of copies that are made from now on.
    void place_textures(TextureMemory where) {
        const std::lock_guard<std::recursive_mutex> lock(mutex_);
        textures_ = where;
        if (host_) host_->place_textures(where);
    }

    /// `T`: CwbvhAccel, EmbreeAccel, Faces, LightTree; in builds with CUDA also DeviceScene, DeviceCwbvh,
    /// DeviceLightTree, HostTexels (backends/cuda/device_scene.h).
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
    SharedAccels* const host_ = nullptr;  ///< whose structures on the host these are; null: its own
    TextureMemory textures_ = TextureMemory::device;
    std::shared_ptr<Structures> structures_;
    std::recursive_mutex mutex_;  ///< some are made from others
    std::shared_ptr<const LightTree> light_tree_;
    std::shared_ptr<const DeviceScene> device_scene_;
    std::shared_ptr<const DeviceCwbvh> device_cwbvh_;
    std::shared_ptr<const DeviceLightTree> device_light_tree_;
    std::shared_ptr<const HostTexels> host_texels_;
};

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get<CwbvhAccel>();
template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get<EmbreeAccel>();
template <>
std::shared_ptr<const Faces> SharedAccels::get<Faces>();
template <>
std::shared_ptr<const LightTree> SharedAccels::get<LightTree>();

}  // namespace ambilux
