#include "scene/accel/shared_accels.h"

#include "scene/accel/cwbvh.h"
#include "scene/accel/embree_tracer.h"

namespace ambilux {

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get() {
    if (!cwbvh_) cwbvh_ = std::make_shared<const CwbvhAccel>(scene_);
    return cwbvh_;
}

template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get() {
    if (!embree_) embree_ = std::make_shared<const EmbreeAccel>(scene_);
    return embree_;
}

}  // namespace ambilux
