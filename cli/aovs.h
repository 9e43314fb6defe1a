// Layers of `ambilux render --aov`.
#pragma once

#include <string>
#include <vector>

#include "film/layer.h"
#include "film/moments.h"
#include "integrators/settings.h"
#include "scene/scene.h"

namespace ambilux {

/// Camera paths of a pixel that layers of surfaces are made from, or all of a render that has fewer.
constexpr uint32_t kAovSamples = 64;

/// Those of surfaces (render/aov.h) and, of the render itself, `samples` and `variance`.
std::vector<std::string> known_aovs();

/// Throws Error(usage) that names a layer which is not known or asked for twice.
void check_aovs(const std::vector<std::string>& names);

/// The layers of these names, in their order. variance: of a pixel's mean.
std::vector<Layer> make_aovs(const Scene& scene, const RenderSettings& settings, const FilmMoments& film,
                             const std::vector<std::string>& names);

}  // namespace ambilux
