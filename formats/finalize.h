// What follows from the arrays of a scene once they are complete.
#pragma once

#include "scene/scene.h"

namespace ambilux {

/// How light sampling chooses among emitters.
enum class LightPicking : uint32_t { power, uniform };

/// Fills in what follows from the rest once shapes, materials, textures, emitters and sensor are set: shape areas and
/// their cdfs, pick probabilities, environment densities, filter table, bounds, features. Call it once after the arrays
/// are complete.
void finalize_scene(Scene& scene, LightPicking light_picking);

}  // namespace ambilux
