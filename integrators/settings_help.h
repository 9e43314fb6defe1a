// All settings and variants for people (ambilux help settings, docs/reference.md).
#pragma once

#include <string>

namespace ambilux {

/// A block of lines for each setting.
std::string settings_help();
/// The same as tables in Markdown, of variants in the tree: docs/reference.md.
std::string settings_reference();

}  // namespace ambilux
