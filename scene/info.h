// What is in a scene, for people and for files.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace ambilux {

const char* name_of(FilterType type);

/// Names of the features, in a fixed order: bsdf types, emitter types, primitive types, then textures, bumps, opacity,
/// blends.
std::vector<std::string> feature_names(const Features& features);

/// Counts per type, triangles, memory, sensor, film, integrator hint, features, warnings.
nlohmann::json scene_info(const Scene& scene);

}  // namespace ambilux
