// Parts of spheres, disks and cylinders, as meshes.
#pragma once

#include "formats/meshes/mesh.h"
#include "formats/pbrt/parameters.h"

namespace ambilux::pbrt {

/// True if parameters of a sphere, disk or cylinder leave out a part of it.
bool is_cut(const Parameters& in);

/// The part that is left, with pbrt's normals and coordinates, and its exact area in its own space.
Mesh cut_quadric(const Parameters& in, double& area);

}  // namespace ambilux::pbrt
