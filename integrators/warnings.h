// What a user should know before a render: light that the settings leave out, and numbers at the edge of what floats or
// Russian roulette can do (docs/numerics.md).
#pragma once

#include <string>
#include <vector>

#include "integrators/settings.h"
#include "scene/scene.h"

namespace ambilux {

/// Sentences; empty if there is nothing to say. `settings`: as used, after bdpt.auto has chosen.
std::vector<std::string> render_warnings(const Scene& scene, const RenderSettings& settings);

}  // namespace ambilux
