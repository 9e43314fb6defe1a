// What somebody may have meant by a name that is not known.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace ambilux {

using Names = std::vector<std::string>;

/// The one of these that the field calls so too (albedo: reflectance), or that differs from `name` by a letter or two;
/// empty if there is none.
std::string nearest_name(const Names& known, const std::string& name);
/// The end of a message about `name`: which of these it nearly is; empty if none.
std::string suggestion(const Names& known, const std::string& name);
/// The same, or if it is none of them nearly, the names of all.
std::string suggestion_or_all(const Names& known, const std::string& name);
template <class T>
std::string suggestion(const std::map<std::string, T>& known, const std::string& name) {
    Names names;
    for (const auto& entry : known) names.push_back(entry.first);
    return suggestion(names, name);
}

}  // namespace ambilux
