#include "backends/cuda/device_scene.h"

#include "backends/cuda_device.h"
#include "backends/scene_fit.h"

namespace ambilux {

DeviceScene::DeviceScene(const Scene& scene, std::shared_ptr<const HostTexels> texels)
    : vertices_(scene.vertices, "vertices on the device"), triangles_(scene.triangles, "triangles on the device"),
      quadrics_(scene.quadrics, "analytic shapes on the device"), groups_(scene.groups, "groups on the device"),
      instances_(scene.instances, "instances on the device"), shapes_(scene.shapes, "shapes on the device"),
      materials_(scene.materials, "materials on the device"), bsdfs_(scene.bsdfs, "BSDFs on the device"),
      textures_(scene.textures, "texture records on the device"),
      texels_(texels ? std::span<const uint8_t>() : std::span<const uint8_t>(scene.texels), "texels on the device"),
      host_texels_(std::move(texels)), sort_keys_(scene.sort_keys, "sort keys on the device"),
      emitters_(scene.emitters, "emitters on the device"),
      emitter_cdf_(scene.emitter_cdf, "emitter probabilities on the device"),
      tables_(scene.tables, "tables on the device"),
      environment_rows_(scene.environment_rows, "density of the environment on the device"),
      environment_cells_(scene.environment_cells, "density of the environment on the device"), view_(scene.view()) {
    view_.vertices = vertices_.data();
    view_.triangles = triangles_.data();
    view_.quadrics = quadrics_.data();
    view_.groups = groups_.data();
    view_.instances = instances_.data();
    view_.shapes = shapes_.data();
    view_.materials = materials_.data();
    view_.bsdfs = bsdfs_.data();
    view_.textures = textures_.data();
    view_.texels = host_texels_ ? host_texels_->data() : texels_.data();
    view_.sort_keys = sort_keys_.data();
    view_.emitters = emitters_.data();
    view_.emitter_cdf = emitter_cdf_.data();
    view_.tables = tables_.data();
    view_.environment_rows = environment_rows_.data();
    view_.environment_cells = environment_cells_.data();
}

uint64_t DeviceScene::bytes() const {
    return vertices_.bytes() + triangles_.bytes() + quadrics_.bytes() + groups_.bytes() + instances_.bytes() +
           shapes_.bytes() + materials_.bytes() + bsdfs_.bytes() + textures_.bytes() + texels_.bytes() +
           sort_keys_.bytes() + emitters_.bytes() + emitter_cdf_.bytes() + tables_.bytes() + environment_rows_.bytes() +
           environment_cells_.bytes();
}

DeviceCwbvh::DeviceCwbvh(const CwbvhArrays& arrays)
    : nodes_(arrays.nodes, "acceleration structure on the device"),
      primitives_(arrays.primitives, "primitives on the device") {}

DevicePairs::DevicePairs(const PairArrays& arrays)
    : nodes_(arrays.nodes, "acceleration structure on the device"),
      primitives_(arrays.primitives, "primitives on the device"), root_(arrays.root) {}

DeviceLightTree::DeviceLightTree(const LightTree& tree)
    : nodes_(tree.nodes(), "light tree on the device"), leaves_(tree.leaves(), "lights on the device"),
      first_leaf_(tree.first_leaf(), "lights on the device"), beside_(tree.beside(), "lights on the device") {
    LightTreeView view = *tree.view();
    view.nodes = nodes_.data();
    view.leaves = leaves_.data();
    view.first_leaf = first_leaf_.data();
    view.beside = beside_.data();
    view_ = DeviceBuffer<LightTreeView>(std::vector<LightTreeView>{view}, "light tree on the device");
}

template <>
std::shared_ptr<const HostTexels> SharedAccels::get() {
    return once(host_texels_, [&] {
        return host_ ? host_->get<HostTexels>() : std::make_shared<const HostTexels>(scene_.texels, textures_);
    });
}

template <>
std::shared_ptr<const DeviceScene> SharedAccels::get() {
    return once(device_scene_, [&] {
        // With the structure, if it is made: it comes next.
        size_t free = 0, total = 0;
        cuda_check(cudaMemGetInfo(&free, &total), "device memory");
        const uint64_t accel_bytes = (structures_->cwbvh ? structures_->cwbvh->memory_bytes() : 0) +
                                     (light_tree_ ? light_tree_->memory_bytes() : 0);
        check_scene_fits(scene_, textures_, accel_bytes, free, total, cuda_device_name());
        const bool on_host = textures_ != TextureMemory::device;
        return std::make_shared<const DeviceScene>(scene_, on_host ? get<HostTexels>() : nullptr);
    });
}

template <>
std::shared_ptr<const DeviceCwbvh> SharedAccels::get() {
    return once(device_cwbvh_, [&] { return std::make_shared<const DeviceCwbvh>(get<CwbvhAccel>()->arrays()); });
}

template <>
std::shared_ptr<const DeviceLightTree> SharedAccels::get() {
    return once(device_light_tree_, [&] { return std::make_shared<const DeviceLightTree>(*get<LightTree>()); });
}

}  // namespace ambilux
