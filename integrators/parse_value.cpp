#include "integrators/parse_value.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "core/error.h"

namespace ambilux {

void refuse_value(const std::string& key, const std::string& value, const std::string& allowed) {
    throw Error(ExitCode::usage, fmt::format("{}={}: {}", key, value, allowed));
}

namespace {

const char* const kUnits = "KMGT";

}  // namespace

uint64_t parse_bytes(const std::string& key, const std::string& value) {
    const size_t digits = std::min(value.find_first_not_of("0123456789"), value.size());
    const size_t unit = digits + 1 == value.size() ? std::string(kUnits).find(value[digits]) : std::string::npos;
    const uint32_t shift = unit == std::string::npos ? 0 : 10 * uint32_t(unit + 1);
    uint64_t number = 0;
    const auto parsed = std::from_chars(value.data(), value.data() + digits, number);
    const bool whole = digits == value.size() || shift > 0;
    if (parsed.ec != std::errc() || !whole || number == 0 || number > ~uint64_t(0) >> shift)
        refuse_value(key, value, "bytes are needed, such as 512M or 4G (powers of 1024), or all");
    return number << shift;
}

std::string text_of_bytes(uint64_t bytes) {
    size_t unit = 0;
    while (unit < 4 && bytes > 0 && bytes % 1024 == 0) bytes /= 1024, ++unit;
    return std::to_string(bytes) + (unit ? std::string(1, kUnits[unit - 1]) : "");
}

size_t parse_choice(const std::string& key, const std::string& value, const std::vector<std::string>& names) {
    const auto at = std::find(names.begin(), names.end(), value);
    if (at == names.end()) refuse_value(key, value, fmt::format("allowed are {}", fmt::join(names, ", ")));
    return size_t(at - names.begin());
}

}  // namespace ambilux
