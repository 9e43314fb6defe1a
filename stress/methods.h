// The methods that every cell is rendered with.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "session/hooks.h"
#include "stress/cell.h"

namespace ambilux::stress {

struct Method {
    std::string name;
    std::vector<std::pair<std::string, std::string>> settings;
    bool quick = true;  ///< part of --quick
    double bias = 0;    ///< Stressed::bias
};

/// What variants say in their folders, in the order of the registry.
const std::vector<Method>& methods();

/// Settings of a render of `scene`, whose depths are those of its file.
RenderSettings settings_of(const Hooks& hooks, const Method& method, const Cell& cell, const Scene& scene,
                           const std::string& backend, uint64_t seed);

/// Whether `text`, prefixes separated by blanks, has one of `name`.
bool has_prefix_of(const std::string& text, const std::string& name);

}  // namespace ambilux::stress
