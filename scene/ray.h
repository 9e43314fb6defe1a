// Rays and hits, shared by every tracer.
#pragma once

#include "scene/view.h"

namespace ambilux {

/// Ray from `o` along unit `d`; hits count for 0 < t < tmax. `alpha_seed` decides, with the primitive, whether a
/// surface of partial opacity lets this ray pass (core/rng.h, hash_float), so that the answer does not depend on
/// traversal order.
struct Ray {
    Vec3f o;
    float tmax;
    Vec3f d;
    uint32_t alpha_seed;
};

/// Nearest hit. `prim == kNone` means none. (u,v): triangle: barycentrics of v1 and v2. Sphere: octahedral map of the
/// local unit normal, each in [-1,1]. Disk: local (x,y). Cylinder: (local azimuth in [-pi,pi], local z).
struct Hit {
    float t;
    float u, v;
    uint32_t prim;
};

}  // namespace ambilux
