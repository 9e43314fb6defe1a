// Mitsuba's XML as a tree of objects: includes, parameters, search folders, aliases and references are resolved.
#pragma once

#include "formats/document/document.h"

namespace ambilux::mitsuba {

using namespace document;

/// Parses the file, or `text` as if the file held it. `parameters` replace <default>s; one that the file does not use
/// is an error. Throws Error(bad_input) with file and line.
Document parse_document(const std::string& path, const std::vector<std::pair<std::string, std::string>>& parameters,
                        const Limits& limits = {}, const std::string* text = nullptr);

}  // namespace ambilux::mitsuba
