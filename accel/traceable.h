// Which rays tracers follow.
#pragma once

#include "scene/ray.h"

namespace ambilux {

/// Most rays that a host traces together.
constexpr uint32_t kMostPacketRays = 16;

/// True for rays that a tracer may follow; all others (not finite, no direction, empty interval) hit nothing.
AMBILUX_HD bool is_traceable(const Ray& ray) {
    const Vec3f o = abs(ray.o), d = abs(ray.d);
    const float slope = d.x + d.y + d.z;
    return (slope > 0.0f) & (ray.tmax > 0.0f) & (o.x + o.y + o.z + slope < kInfinity);  // false for NaN
}

}  // namespace ambilux
