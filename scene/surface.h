// From a hit to a point on a surface.
#pragma once

#include "core/sampling.h"
#include "scene/ray.h"

namespace ambilux {

/// Point on a surface, world space.
struct SurfacePoint {
    Vec3f p;
    Vec3f p_error;  ///< bound of the absolute error of each coordinate of p
    Vec3f ng;       ///< unit geometric normal; on triangles with vertex normals it lies on their side
    Vec3f ns;       ///< unit shading normal (interpolated), dot(ns, ng) may be negative only for absurd vertex normals
    Vec3f dpdu, dpdv;  ///< partial derivatives of p by uv; zero or arbitrary tangents where uv do not define them
    Vec2f uv;       ///< texture coordinates as in Mitsuba: triangles without uvs use barycentrics (b1,b2)
    uint32_t prim, shape;
};

