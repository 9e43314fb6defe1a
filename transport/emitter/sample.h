// What sampling light towards a point returns.
#pragma once

#include "scene/surface.h"

namespace ambilux {

/// Light that arrives at a reference point from one direction (next event estimation). With f the BSDF times the cosine
/// at the reference, the contribution is f · radiance / pdf_sa if nothing lies between.
struct EmitterSample {
    Vec3f p;         ///< point on the emitter; for environment and directional a point beyond the scene's bounds
    Vec3f p_error;   ///< bound of the absolute error of each coordinate of p; zero where p is exact or at infinity
    Vec3f ng;        ///< area: unit normal of the emitting side; otherwise -wi
    Vec3f wi;        ///< unit, from the reference to the light
    float distance;  ///< from the reference to p; kInfinity for environment and directional
    Rgb radiance;    ///< area, constant, envmap: radiance towards the reference; point, spot: intensity / distance²;
                     ///< directional: irradiance
    Vec2f env_uv;    ///< envmap: where in the image wi points; other types leave it alone
    float pdf_sa;  ///< density of wi per solid angle times the pick probability; for delta lights the pick probability
                   ///< alone
    bool delta;    ///< no other strategy can find this light: point, spot, directional
    uint32_t emitter;
    uint32_t prim;  ///< area: the primitive that p lies on; other types leave it alone
};

}  // namespace ambilux
