// Subdivision surfaces of triangles.
#pragma once

#include <string>

#include "formats/meshes/mesh.h"

namespace ambilux {

/// The mesh after `levels` steps of Loop's scheme (Loop 1987, with the weights of Warren 1995; boundaries are cubic
/// splines), its vertices moved to the limit surface, with smooth normals. Texture coordinates are left out.
/// Edges that more than two triangles share are refused.
Mesh subdivide_loop(const std::string& path, const Mesh& mesh, int levels, const Limits& limits);

}  // namespace ambilux
