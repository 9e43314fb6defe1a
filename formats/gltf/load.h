// Scenes of glTF 2.0.
#pragma once

#include "formats/load.h"

namespace ambilux {

/// Loads a scene from a .gltf or .glb file. Throws Error(bad_input) that names the file and the part of it.
Scene load_gltf(const std::string& path, const LoadOptions& options = {});

}  // namespace ambilux
