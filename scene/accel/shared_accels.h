// Acceleration structures of one scene for several renderers.
#pragma once

#include <memory>

#include "scene/scene.h"

namespace ambilux {

class CwbvhAccel;
class EmbreeAccel;

/// Each is built when it is first asked for. The scene must outlive them.
class SharedAccels {
public:
    explicit SharedAccels(const Scene& scene) : scene_(scene) {}

    /// `Accel`: CwbvhAccel or EmbreeAccel.
    template <class Accel>
    std::shared_ptr<const Accel> get();

private:
    const Scene& scene_;
    std::shared_ptr<const CwbvhAccel> cwbvh_;
    std::shared_ptr<const EmbreeAccel> embree_;
};

template <>
std::shared_ptr<const CwbvhAccel> SharedAccels::get<CwbvhAccel>();
template <>
std::shared_ptr<const EmbreeAccel> SharedAccels::get<EmbreeAccel>();

}  // namespace ambilux
