// Keys of TOML files that would make tables deeper than the parser's stack.
#pragma once

#include <string>
#include <string_view>

namespace ambilux {

/// Throws Error(bad_input) with file and line for a key of too many dotted parts. Each part is a table in a table, and
/// the TOML library visits them by recursion; it limits nested values itself, but not these.
void check_key_depth(const std::string& file, std::string_view text);

}  // namespace ambilux
