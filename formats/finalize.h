// What follows from the arrays of a scene once they are complete.
#pragma once

#include "formats/light_picking.h"
#include "scene/scene.h"

namespace ambilux {

/// In Scene::texels.
constexpr uint32_t bytes_of_texel(TexelFormat format) {
    return format == TexelFormat::rgba8 ? 4 : format == TexelFormat::rgba16f ? 8 : 16;
}

/// Fills in what follows from the rest once shapes, materials, textures, emitters and sensor are set: shape areas and
/// their cdfs, pick probabilities, environment densities, filter table, bounds, features. Call it once after the arrays
/// are complete. What follows from the same as in `before`, a finished scene that shares arrays with this one, is taken
/// from there.
void finalize_scene(Scene& scene, LightPicking light_picking, const Scene* before = nullptr);

}  // namespace ambilux
