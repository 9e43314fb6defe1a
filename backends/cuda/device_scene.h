// Copies of a scene and of its acceleration structure on a CUDA device.
#pragma once

#include "accel/cwbvh.h"
#include "accel/light_tree.h"
#include "accel/pair_bvh.h"
#include "accel/shared_accels.h"
#include "backends/cuda/device_memory.h"
#include "backends/cuda/host_texels.h"
#include "scene/scene.h"

namespace ambilux {

/// A scene's arrays on the device, its texels there or on the host. The scene may be changed or destroyed afterwards.
class DeviceScene {
public:
    /// Throws Error(device) when memory runs out. `texels`: those of the scene if they stay on the host; else null.
    explicit DeviceScene(const Scene& scene, std::shared_ptr<const HostTexels> texels = {});

    /// Pointers are to device memory, valid as long as this object.
    SceneView view() const { return view_; }
    /// On the device, without what the driver keeps there of texels that lie on the host.
    uint64_t bytes() const;
    /// What bytes() will be, with texels on the device.
    static uint64_t predicted_bytes(const Scene& scene) { return scene.memory_bytes(); }
    /// Of texels that lie on the host, HostTexels::drop() and prefetch().
    void drop_texels() const {
        if (host_texels_) host_texels_->drop();
    }
    void prefetch_texels(cudaStream_t stream) const {
        if (host_texels_) host_texels_->prefetch(stream);
    }

private:
    DeviceBuffer<MeshVertex> vertices_;
    DeviceBuffer<Triangle> triangles_;
    DeviceBuffer<Quadric> quadrics_;
    DeviceBuffer<Group> groups_;
    DeviceBuffer<Instance> instances_;
    DeviceBuffer<Shape> shapes_;
    DeviceBuffer<Material> materials_;
    DeviceBuffer<BsdfRecord> bsdfs_;
    DeviceBuffer<Texture> textures_;
    DeviceBuffer<uint8_t> texels_;
    std::shared_ptr<const HostTexels> host_texels_;  ///< instead
    DeviceBuffer<uint16_t> sort_keys_;
    DeviceBuffer<Emitter> emitters_;
    DeviceBuffer<float> emitter_cdf_, tables_;
    DeviceBuffer<AliasBucket> environment_rows_;
    DeviceBuffer<EnvironmentCell> environment_cells_;
    SceneView view_;
};

/// An acceleration structure on the device.
class DeviceCwbvh {
public:
    /// Throws Error(device) when memory runs out.
    explicit DeviceCwbvh(const CwbvhArrays& arrays);

    /// For device code only; valid as long as this object.
    CwbvhTracer tracer() const { return make_tracer(nodes_.data(), primitives_.data()); }
    uint64_t bytes() const { return nodes_.bytes() + primitives_.bytes(); }
    /// What bytes() will be.
    static uint64_t predicted_bytes(const CwbvhArrays& arrays) { return arrays.bytes(); }

protected:
    DeviceCwbvh() = default;

    DeviceBuffer<CwbvhNode> nodes_;
    DeviceBuffer<CwbvhPrimitive> primitives_;
};

/// One that the device builds (backends/fast_build.h), of a scene without groups.
class DeviceFastCwbvh : public DeviceCwbvh {
public:
    /// `scene`: on the device. Throws Error(device) when memory runs out or the tree is deeper than traversal stacks.
    explicit DeviceFastCwbvh(const SceneView& scene);

    double build_seconds() const { return build_seconds_; }
    /// While it was built.
    uint64_t peak_bytes() const { return peak_bytes_; }
    static uint64_t predicted_peak_bytes(const SceneView& scene);
    /// A copy on the host.
    CwbvhArrays arrays() const { return {nodes_.download(), primitives_.download(), depth_}; }

private:
    uint32_t depth_ = 0;
    uint64_t peak_bytes_ = 0;
    double build_seconds_ = 0;
};

/// A binary BVH on the device, likewise.
class DevicePairs {
public:
    explicit DevicePairs(const PairArrays& arrays);

    PairTracer tracer() const { return {nodes_.data(), primitives_.data(), root_}; }
    uint64_t bytes() const { return nodes_.bytes() + primitives_.bytes(); }

private:
    DeviceBuffer<PairNode> nodes_;
    DeviceBuffer<CwbvhPrimitive> primitives_;
    uint32_t root_;
};

/// A tree over lights on the device.
class DeviceLightTree {
public:
    explicit DeviceLightTree(const LightTree& tree);
    DeviceLightTree(const DeviceLightTree&) = delete;
    DeviceLightTree& operator=(const DeviceLightTree&) = delete;

    /// For SceneView::light_tree, in device code only; valid as long as this object.
    const LightTreeView* view() const { return view_.data(); }
    /// What light_tree_bytes() predicts.
    uint64_t bytes() const {
        return nodes_.bytes() + leaves_.bytes() + first_leaf_.bytes() + beside_.bytes() + view_.bytes();
    }

private:
    DeviceBuffer<LightNode> nodes_;
    DeviceBuffer<LightLeaf> leaves_;
    DeviceBuffer<uint32_t> first_leaf_, beside_;
    DeviceBuffer<LightTreeView> view_;
};

template <>
std::shared_ptr<const HostTexels> SharedAccels::get<HostTexels>();
template <>
std::shared_ptr<const DeviceScene> SharedAccels::get<DeviceScene>();
template <>
std::shared_ptr<const DeviceCwbvh> SharedAccels::get<DeviceCwbvh>();
template <>
std::shared_ptr<const DeviceFastCwbvh> SharedAccels::get<DeviceFastCwbvh>();
template <>
std::shared_ptr<const DeviceLightTree> SharedAccels::get<DeviceLightTree>();

}  // namespace ambilux
