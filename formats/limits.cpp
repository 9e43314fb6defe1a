#include "formats/limits.h"

#include <charconv>

#include "core/error.h"

namespace ambilux {

namespace {

struct Named {
    const char* name;
    uint64_t Limits::* value;
};

constexpr Named kLimits[] = {
    {"pixels", &Limits::pixels},       {"bytes", &Limits::bytes},     {"total_bytes", &Limits::total_bytes},
    {"shapes", &Limits::shapes},       {"copies", &Limits::copies},   {"includes", &Limits::includes},
    {"expansion", &Limits::expansion}, {"nesting", &Limits::nesting}, {"seconds", &Limits::seconds},
};

/// Elements are visited by recursion: more may not fit the stack.
constexpr uint64_t kMostNesting = 2000;

/// A whole number with an ending; false if it is none, or 0, or too large.
bool parse_count(const std::string& text, uint64_t& value) {
    const char* const end = text.data() + text.size();
    const auto result = std::from_chars(text.data(), end, value);
    if (result.ec != std::errc() || value == 0) return false;
    const std::string ending(result.ptr, end);
    const int bits = ending.empty() ? 0 : ending == "K" ? 10 : ending == "M" ? 20 : ending == "G" ? 30 : -1;
    if (bits < 0 || value > (UINT64_MAX >> 1 >> bits)) return false;
    value <<= bits;
    return true;
}

}  // namespace

void set_limit(Limits& limits, const std::string& assignment) {
    const size_t at = assignment.find('=');
    const std::string key = assignment.substr(0, at);
    for (const Named& n : kLimits) {
        if (key != n.name) continue;
        uint64_t value = 0;
        if (at == std::string::npos || !parse_count(assignment.substr(at + 1), value))
            throw Error(ExitCode::usage,
                        "--limits " + assignment + ": write it as " + key + "=N, N from 1, such as 8G");
        if (n.value == &Limits::nesting && value > kMostNesting)
            throw Error(ExitCode::usage, "--limits " + assignment + ": at most " + std::to_string(kMostNesting));
        limits.*n.value = value;
        return;
    }
    throw Error(ExitCode::usage, "--limits " + assignment + ": known are " + limits_text({}));
}

std::string limits_text(const Limits& limits) {
    std::string text;
    for (const Named& n : kLimits)
        text += (text.empty() ? "" : ", ") + std::string(n.name) + "=" + std::to_string(limits.*n.value);
    return text;
}

}  // namespace ambilux
