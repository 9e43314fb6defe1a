#include "accel/shared_accels.h"

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "accel/faces.h"
#include "accel/light_tree.h"

namespace ambilux {

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get() {
    return once(cwbvh_, [&] { return host_ ? host_->get<CwbvhAccel>() : std::make_shared<const CwbvhAccel>(scene_); });
}

template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get() {
    return once(embree_,
                [&] { return host_ ? host_->get<EmbreeAccel>() : std::make_shared<const EmbreeAccel>(scene_); });
}

template <>
std::shared_ptr<const Faces> SharedAccels::get() {
    return once(faces_, [&] { return host_ ? host_->get<Faces>() : std::make_shared<const Faces>(scene_); });
}

template <>
std::shared_ptr<const LightTree> SharedAccels::get() {
    return once(light_tree_,
                [&] { return host_ ? host_->get<LightTree>() : std::make_shared<const LightTree>(scene_); });
}

}  // namespace ambilux
