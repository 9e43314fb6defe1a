// Types of objects that scene files can have. Each list stands beside the builder that knows them.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/nearest.h"

namespace ambilux::document {

using Plugins = Names;

const Plugins& bsdf_plugins();
const Plugins& emitter_plugins();
const Plugins& film_plugins();
const Plugins& filter_plugins();
const Plugins& integrator_plugins();
const Plugins& sampler_plugins();
const Plugins& sensor_plugins();
const Plugins& shape_plugins();
const Plugins& texture_plugins();

/// The list and, behind it, the plugins of all models.
template <class Models>
Plugins with_plugins_of(Plugins list = {}) {
    Models::for_each([&](auto model) { list.emplace_back(decltype(model)::type::plugin); });
    return list;
}

bool is_one_of(const Plugins& plugins, const std::string& type);

/// Why `type` may have been written for an object with this tag, as the end of a message: it is another kind of object,
/// or nearly one of these; empty if neither.
std::string what_is_meant(const std::string& tag, const std::string& type);

/// The tag of each type: no two tags share one.
std::map<std::string, std::string> plugins();

}  // namespace ambilux::document
