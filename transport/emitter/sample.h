// What sampling the light of emitters returns.
#pragma once

#include "scene/surface.h"

namespace ambilux {

/// Functions of an emitter: a specialisation in transport/emitter/NAME.h for every model of the list, with
///   sample_direct<F>(view, emitter, reference_p, u, s): light towards a point, as sample_emitter_deferred has it; u.x
///   and u.y place the sample, u.z picks the primitive or row;
///   sample_emission<F>(view, emitter, u, u_direction, s): light that leaves, as sample_emission has it: s.d,
///   s.pdf_dir, and what differs from the defaults there; pdf_emission_direction<F>(view, emitter, ng, d): its
///   s.pdf_dir.
template <class Model>
struct EmitterFunctions;

/// Light that arrives at a reference point from one direction (next event estimation). With f the BSDF times the cosine
/// at the reference, the contribution is f · radiance / pdf_sa if nothing lies between.
struct EmitterSample {
    Vec3f p;         ///< point on the emitter; for environment and directional a point beyond the scene's bounds
    Vec3f p_error;   ///< bound of the absolute error of each coordinate of p; zero where p is exact or at infinity
    Vec3f ng;        ///< area, hidden_area: unit normal of the emitting side; otherwise -wi
    Vec3f wi;        ///< unit, from the reference to the light
    float distance;  ///< from the reference to p; kInfinity for environment and directional
    Rgb radiance;    ///< area, constant, envmap: radiance towards the reference; point, spot: intensity / distance²;
                     ///< directional: irradiance; hidden_area: radiance · area · cosine / distance²
    Vec2f env_uv;    ///< envmap: where in the image wi points; other types leave it alone
    float pdf_sa;  ///< density of wi per solid angle times the pick probability; for delta lights the pick probability
                   ///< alone
    bool delta;    ///< no ray can find this light: point, spot, directional, hidden_area
    uint32_t emitter;
    uint32_t prim;  ///< area: the primitive that p lies on; other types leave it alone
    float opacity;  ///< area: chance that a ray meets the emitter at p; other types leave it alone
};

/// Light that leaves an emitter (transport/emitter/emission.h).
struct EmissionSample {
    Vec3f p;          ///< where the subpath starts; infinite: outside of the scene's bounding sphere
    Vec3f p_error;    ///< bound of the absolute error of each coordinate of p; zero unless p lies on a surface
    Vec3f ng;         ///< unit normal of the emitting side; d where there is no surface
    Vec3f d;          ///< unit, direction in which light leaves
    Rgb radiance;     ///< area, constant, envmap: radiance; point, spot: intensity; directional: irradiance;
                      ///< collimated: power; directional_area: power per area; hidden_area:
                      ///< radiance · area
    float pdf_pos;    ///< density per area (infinite: on the disk); 1 for a delta position
    float pdf_dir;    ///< density per solid angle; 1 for a delta direction
    float cos_theta;  ///< cosine between the surface's normal and d; 1 where there is no surface
    float pick;       ///< probability of this emitter
    uint32_t emitter;
    uint32_t prim;  ///< area: the primitive that p lies on; otherwise kNone
    float opacity;  ///< area: chance that a ray meets the emitter at p; otherwise 1
    bool delta_position, delta_direction, infinite;
};

}  // namespace ambilux
