// The names that pbrt-v4 has, for messages about names that it does not have.
#pragma once

#include <string>

namespace ambilux::pbrt {

/// Whether pbrt-v4 has a name of that kind. `kind`: directive, camera, filter, film, integrator,
/// sampler, shape, material, light or texture type.
bool is_known(const std::string& kind, const std::string& name);
/// Which of them it nearly is, as the end of a message.
std::string nearly_known(const std::string& kind, const std::string& name);
/// "KIND 'name' is not supported", with the same end.
std::string not_supported(const std::string& kind, const std::string& name);

}  // namespace ambilux::pbrt
