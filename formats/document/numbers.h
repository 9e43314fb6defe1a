// Numbers in texts of parameters.
#pragma once

#include <string>
#include <vector>

#include "formats/document/document.h"

namespace ambilux::document {

/// Both throw Error(bad_input) that says where, and `what` the text is.
double parse_number(const std::string& text, const Where& where, const std::string& what);
/// Numbers separated by commas or blanks.
std::vector<double> parse_list(const std::string& text, const Where& where, const std::string& what);

}  // namespace ambilux::document
