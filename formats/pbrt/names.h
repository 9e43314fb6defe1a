// The names that pbrt-v4 has, for messages about names that it does not have.
#pragma once

#include <string>

namespace ambilux::pbrt {

/// Which name of that kind it nearly is, as the end of a message. `kind`: directive, camera, filter, film, integrator,
/// shape, material, light or texture type.
std::string nearly_known(const std::string& kind, const std::string& name);
/// "KIND 'name' is not supported", with the same end.
std::string not_supported(const std::string& kind, const std::string& name);

}  // namespace ambilux::pbrt
