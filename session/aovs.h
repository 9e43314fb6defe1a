// Layers that an image has besides light.
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

/// Those of surfaces (render/aov.h) and, of the render itself, `samples`, `variance` and `connections`.
std::vector<std::string> known_aovs();

/// Throws Error(usage) that names a layer which is not known or asked for twice. `prefix` stands before "aov".
void check_aovs(const std::vector<std::string>& names, const std::string& prefix);
/// Throws Error(usage) for a layer that a render with these settings cannot have.
void check_aovs_of(const RenderSettings& settings, const std::vector<std::string>& names, const std::string& prefix);

/// The layers of these names, in their order, with the settings that a render used. variance: of a pixel's mean.
std::vector<Layer> make_aovs(const Scene& scene, const RenderSettings& settings, const FilmMoments& film,
                             const std::vector<std::string>& names);

}  // namespace ambilux
