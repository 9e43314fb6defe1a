// Text from files, fit for a terminal.
#pragma once

#include <string>
#include <string_view>

namespace ambilux {

/// The text with \xNN for control characters other than line ends and tabs, and for what is not UTF-8. Of very long
/// texts the beginning and their length.
std::string printable(std::string_view text);

}  // namespace ambilux
