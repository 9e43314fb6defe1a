// Values from text. What is not allowed is refused with Error(usage) that names the key, the value and what is.
#pragma once

#include <fmt/format.h>

#include <charconv>
#include <string>
#include <vector>

namespace ambilux {

[[noreturn]] void refuse_value(const std::string& key, const std::string& value, const std::string& allowed);

/// Index of `value` among `names`.
size_t parse_choice(const std::string& key, const std::string& value, const std::vector<std::string>& names);

/// "an integer from 1 to 8"
template <class Number>
std::string allowed_numbers(Number lowest, Number highest) {
    return fmt::format("{} from {} to {}", std::is_integral_v<Number> ? "an integer" : "a number", lowest, highest);
}

/// A whole number of bytes, at least 1, with K, M, G or T for powers of 1024.
uint64_t parse_bytes(const std::string& key, const std::string& value);
/// As parse_bytes takes it, with the largest unit that divides it.
std::string text_of_bytes(uint64_t bytes);

template <class Number>
Number parse_number(const std::string& key, const std::string& value, Number lowest, Number highest) {
    Number result{};
    const char* end = value.data() + value.size();
    const auto parsed = std::from_chars(value.data(), end, result);
    // Written so that NaN fails too.
    if (parsed.ec != std::errc() || parsed.ptr != end || !(result >= lowest && result <= highest))
        refuse_value(key, value, allowed_numbers(lowest, highest) + " is needed");
    return result;
}

}  // namespace ambilux
