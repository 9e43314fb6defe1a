// A camera that looks from a point at another one, and the sensor that it makes of the scene's own.
#pragma once

#include "scene/view.h"

namespace ambilux {

struct LookAt {
    Vec3f origin, target, up;

    bool operator==(const LookAt&) const = default;
};

/// Where `sensor` stands. The target lies as far away as the centre of the scene's bounds, where that is in front.
LookAt look_of(const Sensor& sensor, Vec3f bounds_center, float bounds_radius);

/// Throws Error(usage) if the three do not make a camera.
Sensor placed(const Sensor& sensor, const LookAt& look);

/// The same picture with 1/divisor of the pixels along each side.
Sensor smaller(const Sensor& sensor, uint32_t divisor);

}  // namespace ambilux
