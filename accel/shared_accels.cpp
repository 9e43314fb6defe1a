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

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get() {
    return made_once(structures_->cwbvh);
}

template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get() {
    return made_once(structures_->embree);
}

template <>
std::shared_ptr<const Faces> SharedAccels::get() {
    return made_once(structures_->faces);
}

template <>
std::shared_ptr<const LightTree> SharedAccels::get() {
    return once(light_tree_,
                [&] { return host_ ? host_->get<LightTree>() : std::make_shared<const LightTree>(scene_); });
}

}  // namespace ambilux
