#include "accel/shared_accels.h"

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "accel/faces.h"
#include "accel/light_tree.h"

namespace ambilux {

bool same_structure(const Scene& a, const Scene& b) {
    if (!same_geometry(a, b)) return false;
    if (a.features.bumps != b.features.bumps || a.features.opacity != b.features.opacity) return false;
    for (size_t i = 0; i < a.shapes.size(); ++i)
        if (a.materials[a.shapes[i].material].lets_pass() != b.materials[b.shapes[i].material].lets_pass())
            return false;
    return true;
}

namespace {

template <class T>
std::shared_ptr<const T> made_once(Structures& structures, std::shared_ptr<const T>& made, const Scene& scene) {
    const std::lock_guard<std::recursive_mutex> lock(structures.mutex);
    if (!made) made = std::make_shared<const T>(scene);
    return made;
}

}  // namespace

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get() {
    return made_once(*structures_, structures_->cwbvh, scene_);
}

template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get() {
    return made_once(*structures_, structures_->embree, scene_);
}

template <>
std::shared_ptr<const Faces> SharedAccels::get() {
    return made_once(*structures_, structures_->faces, scene_);
}

template <>
std::shared_ptr<const LightTree> SharedAccels::get() {
    return once(light_tree_,
                [&] { return host_ ? host_->get<LightTree>() : std::make_shared<const LightTree>(scene_); });
}

}  // namespace ambilux
