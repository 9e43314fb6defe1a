// How large a scene is.
#pragma once

#include "scene/scene.h"

namespace ambilux {

/// A column of the 3 x 4 matrix; 3: where the origin goes.
Vec3f column(const Affine& a, int i);

double triangle_area(const Scene& scene, const Triangle& t);

/// Smallest sphere around the centre of the bounding box that holds all surfaces and the camera; of instances their
/// boxes.
void fill_bounds(Scene& scene);

/// Most light from infinity that a scene takes up. No more passes through the sphere around everything than its disk
/// has room for, and no more than falls on all surfaces: of a room with one stone far away the sphere alone would make
/// too much.
struct Receivers {
    double disk;        ///< area that stops parallel light
    double both_sides;  ///< area that light from everywhere falls on
};
Receivers receivers_of(const Scene& scene);

}  // namespace ambilux
