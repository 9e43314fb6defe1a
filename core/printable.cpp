#include "core/printable.h"

#include <fmt/format.h>

namespace ambilux {

namespace {

constexpr size_t kMostShown = 4000;

/// Bytes of the UTF-8 sequence at the front (RFC 3629), 0 if there is none.
size_t sequence_length(std::string_view text) {
    const auto byte = [&](size_t i) { return i < text.size() ? uint8_t(text[i]) : uint8_t(0); };
    const auto follows = [&](size_t count) {
        for (size_t i = 1; i <= count; ++i)
            if ((byte(i) & 0xc0) != 0x80) return false;
        return true;
    };
    const uint8_t a = byte(0), b = byte(1);
    if (a < 0x80) return 1;
    // U+0080 to U+009F are control characters too.
    if (a >= 0xc2 && a <= 0xdf) return follows(1) && !(a == 0xc2 && b < 0xa0) ? 2 : 0;
    if (a >= 0xe0 && a <= 0xef) return follows(2) && !(a == 0xe0 && b < 0xa0) && !(a == 0xed && b >= 0xa0) ? 3 : 0;
    if (a >= 0xf0 && a <= 0xf4) return follows(3) && !(a == 0xf0 && b < 0x90) && !(a == 0xf4 && b >= 0x90) ? 4 : 0;
    return 0;
}

}  // namespace

std::string printable(std::string_view text) {
    std::string out;
    for (size_t i = 0; i < text.size();) {
        if (out.size() > kMostShown) return out + fmt::format("... ({} bytes)", text.size());
        const size_t length = sequence_length(text.substr(i));
        const auto c = uint8_t(text[i]);
        if (length == 0 || (c < 0x20 && c != '\n' && c != '\t') || c == 0x7f) {
            out += fmt::format("\\x{:02x}", c);
            ++i;
        } else {
            out += text.substr(i, length);
            i += length;
        }
    }
    return out;
}

}  // namespace ambilux
