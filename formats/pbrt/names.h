// The names that pbrt-v4 has, for messages about names that it does not have.
#pragma once

#include <string>

namespace ambilux::pbrt {

/// "KIND 'name'", and which name of that kind it nearly is, if any. `kind`: directive, camera, filter, film,
/// integrator, shape, material, light or texture type.
std::string quoted(const std::string& kind, const std::string& name);

}  // namespace ambilux::pbrt
