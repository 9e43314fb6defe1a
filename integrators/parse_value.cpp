#include "integrators/parse_value.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "core/error.h"

namespace ambilux {

void refuse_value(const std::string& key, const std::string& value, const std::string& allowed) {
    throw Error(ExitCode::usage, fmt::format("{}={}: {}", key, value, allowed));
}

size_t parse_choice(const std::string& key, const std::string& value, const std::vector<std::string>& names) {
    const auto at = std::find(names.begin(), names.end(), value);
    if (at == names.end()) refuse_value(key, value, fmt::format("allowed are {}", fmt::join(names, ", ")));
    return size_t(at - names.begin());
}

}  // namespace ambilux
