#include "experiments/toml_depth.h"

#include <algorithm>
#include <cctype>

#include "core/error.h"

namespace ambilux {

namespace {

/// Configurations have three.
constexpr int kMostDots = 32;

/// Behind the string that begins at `at` with a quote: one line, or between three quotes. TOML 1.0, section "String".
size_t string_end(std::string_view text, size_t at) {
    const char quote = text[at];
    const std::string three(3, quote);
    const bool is_long = text.substr(at).starts_with(three);
    for (size_t i = at + (is_long ? 3 : 1); i < text.size(); ++i) {
        if (text[i] == '\\' && quote == '"')
            ++i;
        else if (is_long ? text.substr(i).starts_with(three) : text[i] == quote)
            return i + (is_long ? 3 : 1);
        else if (!is_long && text[i] == '\n')
            return i;
    }
    return text.size();
}

}  // namespace

void check_key_depth(const std::string& file, std::string_view text) {
    int dots = 0;
    for (size_t i = 0; i < text.size();) {
        const char c = text[i];
        if (c == '#') {
            i = std::min(text.find('\n', i), text.size());
            continue;
        }
        if (c == '"' || c == '\'') {
            i = string_end(text, i);
            continue;
        }
        if (c == '.') {
            if (++dots > kMostDots)
                throw input_error(file, 1 + int(std::count(text.begin(), text.begin() + long(i), '\n')),
                                  "a key has more than " + std::to_string(kMostDots) + " dots");
        } else if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-' && c != ' ' && c != '\t') {
            dots = 0;
        }
        ++i;
    }
}

}  // namespace ambilux
