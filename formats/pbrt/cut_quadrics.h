// Spheres, disks and cylinders, and parts of them as meshes.
#pragma once

#include "formats/meshes/mesh.h"
#include "formats/pbrt/parameters.h"

namespace ambilux::pbrt {

/// The parameters of a sphere, disk or cylinder.
struct QuadricShape {
    double radius = 1, inner = 0;  ///< that of the hole in a disk
    double low = 0, high = 0;      ///< along z
    double turn = 0;               ///< about z, in radians
    double area = 0;               ///< exact, in its own space
    bool is_cut = false;           ///< a part of it is left out
};
QuadricShape read_quadric(const Parameters& in);

/// What is there of it, with pbrt's normals and coordinates. `type`: of the shape.
Mesh mesh_of_quadric(const std::string& type, const QuadricShape& q);

}  // namespace ambilux::pbrt
