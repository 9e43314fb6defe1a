// Which rays tracers follow.
#pragma once

#include "scene/ray.h"

namespace ambilux {

/// True for rays that a tracer may follow; all others (not finite, no direction, empty interval) hit nothing.
AMBILUX_HD bool is_traceable(const Ray& ray) { return is_finite(ray.o) && is_finite(ray.d) && ray.tmax > 0.0f && !is_zero(ray.d); }

}  // namespace ambilux
