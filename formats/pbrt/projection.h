// Texture mappings by places instead of coordinates of the shape: cylindrical, spherical, planar.
#pragma once

#include "formats/document/transform.h"
#include "formats/meshes/mesh.h"

namespace ambilux::pbrt {

struct Projection {
    enum class Kind { cylindrical, spherical, planar };
    Kind kind = Kind::planar;
    document::Matrix to_texture;  ///< from the world
    Vec3d v1{1, 0, 0}, v2{0, 1, 0};
    double ds = 0, dt = 0;

    bool operator==(const Projection&) const = default;
};

/// (s,t) of a place in the world.
Vec2f coordinates(const Projection& projection, Vec3d world);

/// The mesh with the (s,t) that its corners have in the world, linear over each triangle. Those of cylinders and
/// spheres do not jump back within a triangle.
Mesh projected(const Mesh& mesh, const document::Matrix& to_world, const Projection& projection);

}  // namespace ambilux::pbrt
