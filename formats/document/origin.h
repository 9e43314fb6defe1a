// Where coordinates of a scene count from.
#pragma once

#include "formats/document/transform.h"
#include "scene/primitive_bounds.h"
#include "scene/scene.h"

namespace ambilux::document {

/// Of all instances and shapes.
Bounds3f surface_bounds(const Scene& scene);

/// The centre of a scene, in its own coordinates, if all shapes and the camera lie so far from (0,0,0), for their size,
/// that floats have lost digits there which they have near it; else (0,0,0). `surfaces`: surface_bounds().
Vec3d far_center(const Scene& scene, const Bounds3f& surfaces);

}  // namespace ambilux::document
