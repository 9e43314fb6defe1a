// Solid textures on a shape, as images of its own.
#pragma once

#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

/// What the images of a shape are made for.
struct BakedMesh {
    Mesh mesh;           ///< with coordinates into them: a block of texels for every triangle
    const Object* bsdf;  ///< with images in the place of all textures
};
/// `mesh` has texture coordinates; `to_world` places it.
BakedMesh bake_solids(SceneMaker& scene, const Where& where, const Mesh& mesh, const Matrix& to_world,
                      const Object& bsdf);

/// Of a whole sphere, disk or cylinder, which keeps its coordinates: images in the place of solid textures alone.
const Object* bake_solids(SceneMaker& scene, const Where& where, Surface surface, const Matrix& to_world,
                          const Object& bsdf);

}  // namespace ambilux::pbrt
