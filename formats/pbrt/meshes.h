// Shapes whose vertices stand in the scene file.
#pragma once

#include <string>

#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

Mesh triangle_mesh(SceneMaker& scene, const Parameters& in);
Mesh bilinear_mesh(SceneMaker& scene, const Parameters& in);
Mesh loop_subdivision(SceneMaker& scene, const Parameters& in);

/// Every triangle gets vertices of its own with pbrt's default coordinates.
Mesh with_default_uvs(const Mesh& mesh);
/// Whether a PLY file gives texture coordinates, as its header tells; what cannot be told counts as yes.
bool has_uvs(const std::string& path);

}  // namespace ambilux::pbrt
