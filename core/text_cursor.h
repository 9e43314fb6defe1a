// Reading numbers and words out of text in memory.
#pragma once

#include <charconv>
#include <limits>
#include <string>
#include <string_view>

namespace ambilux {

/// Position in a text. All reads stay before `end`.
struct TextCursor {
    const char* at;
    const char* end;
    int line = 1;

    explicit TextCursor(std::string_view text) : at(text.data()), end(text.data() + text.size()) {}

    bool done() const { return at >= end; }
    /// Skips blanks within the line.
    void skip_blanks() {
        while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
    }
    bool at_line_end() {
        skip_blanks();
        return at >= end || *at == '\n';
    }
    void next_line() {
        while (at < end && *at != '\n') ++at;
        if (at < end) ++at, ++line;
    }
    /// Skips blanks and line ends.
    void skip_space() {
        for (; at < end && (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n'); ++at) line += *at == '\n';
    }
    /// Next run of characters without blanks; empty at the end of the line.
    std::string_view word() {
        skip_blanks();
        const char* first = at;
        while (at < end && *at != ' ' && *at != '\t' && *at != '\r' && *at != '\n') ++at;
        return {first, size_t(at - first)};
    }
    /// Reads a number right here; false if there is none. "nan", "inf" and "1.#QNAN", as old programs on Windows write
    /// what is no number, are numbers; what is too large for T becomes inf or fails.
    template <class T>
    bool number(T& value) {
        if (at < end && *at == '+') ++at;
        const auto result = std::from_chars(at, end, value);
        if (result.ec == std::errc::invalid_argument) return false;
        if (result.ec == std::errc::result_out_of_range) {
            if constexpr (std::is_floating_point_v<T>) {
                double wide = 0;  // too small or too large for T
                const auto again = std::from_chars(at, end, wide);
                if (again.ec == std::errc())
                    value = T(wide);
                else
                    return false;
            } else {
                return false;
            }
        }
        at = result.ptr;
        if constexpr (std::is_floating_point_v<T>)
            if (at + 1 < end && *at == '#' && at[-1] == '.' && at[1] >= 'I' && at[1] <= 'S')
                word(), value = std::numeric_limits<T>::quiet_NaN();
        return true;
    }
};

}  // namespace ambilux
