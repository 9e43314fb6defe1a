// The names that pbrt-v4 has, for messages about names that it does not have.
#pragma once

#include <map>
#include <string>

#include "formats/document/document.h"
#include "formats/document/plugins.h"

namespace ambilux::pbrt {

/// Whether pbrt-v4 has a name of that kind. `kind`: directive, camera, filter, film, integrator,
/// sampler, shape, material, light or texture type.
bool is_known(const std::string& kind, const std::string& name);
/// Which of them it nearly is, as the end of a message.
std::string nearly_known(const std::string& kind, const std::string& name);
/// "KIND 'name' is not supported", with the same end.
std::string not_supported(const std::string& kind, const std::string& name);

/// What the file calls by that name. `what` it is, for the message if there is none.
template <class T>
const T& known_as(const std::map<std::string, T>& all, const std::string& name, const document::Where& where,
                  const std::string& what) {
    const auto known = all.find(name);
    if (known == all.end()) document::fail(where, "unknown " + what + " '" + name + "'" + suggestion(all, name));
    return known->second;
}

}  // namespace ambilux::pbrt
