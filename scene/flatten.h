// Scenes without instances.
#pragma once

#include "scene/scene.h"

namespace ambilux {

/// The same scene with a copy of its group in place of each instance: shapes of their own behind all others. Groups
/// leave shapes without primitives. Takes and returns finished scenes. Throws Error(bad_input) if there are too many
/// triangles.
Scene flatten_instances(const Scene& scene);

}  // namespace ambilux
