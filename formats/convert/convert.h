// Scenes as files of Mitsuba 3, so that other renderers can have them.
#pragma once

#include <string>
#include <vector>

#include "scene/scene.h"

namespace ambilux {

/// Writes `scene` to an XML file of format 3 at `path`, and its meshes (PLY), textures and environments (PNG, EXR) to a
/// folder beside it, named like the file without its ending and "_files". Returns what Mitsuba 3 takes in another way
/// or not at all. Throws Error(device).
std::vector<std::string> write_mitsuba(const Scene& scene, const std::string& path);

}  // namespace ambilux
