#include "core/text.h"

#include <algorithm>
#include <cstdint>

#include "core/error.h"

namespace ambilux {

namespace {

constexpr std::string_view kMark = "\xEF\xBB\xBF";

std::string with_lf(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for (size_t at = 0; at < text.size();) {
        const size_t cr = std::min(text.find('\r', at), text.size());
        out.append(text, at, cr - at);
        if (cr < text.size()) out += '\n';
        at = cr + (text.substr(cr, 2) == "\r\n" ? 2 : 1);
    }
    return out;
}

void append_utf8(std::string& out, uint32_t c) {
    if (c < 0x80) {
        out += char(c);
        return;
    }
    const int more = c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;
    constexpr uint32_t kFirst[] = {0, 0xC0, 0xE0, 0xF0};
    out += char(kFirst[more] | c >> 6 * more);
    for (int i = more - 1; i >= 0; --i) out += char(0x80 | (c >> 6 * i & 0x3F));
}

/// What is no character becomes the sign for that, U+FFFD.
std::string utf8_of_utf16(std::string_view bytes, bool big_endian) {
    const auto unit = [&](size_t i) {
        return uint32_t(uint8_t(bytes[2 * i + !big_endian])) << 8 | uint8_t(bytes[2 * i + big_endian]);
    };
    std::string out;
    for (size_t i = 0; i < bytes.size() / 2; ++i) {
        uint32_t c = unit(i);
        if (c >= 0xD800 && c < 0xE000) {
            const uint32_t low = c < 0xDC00 && i + 1 < bytes.size() / 2 ? unit(i + 1) : 0;
            const bool is_pair = low >= 0xDC00 && low < 0xE000;
            c = is_pair ? 0x10000 + ((c - 0xD800) << 10) + (low - 0xDC00) : 0xFFFD;
            i += is_pair;
        }
        append_utf8(out, c);
    }
    return out;
}

}  // namespace

std::string_view encoding_of(std::string_view bytes) {
    using namespace std::string_view_literals;
    if (bytes.starts_with("\xFF\xFE\0\0"sv)) return "UTF-32LE";
    if (bytes.starts_with("\0\0\xFE\xFF"sv)) return "UTF-32BE";
    if (bytes.starts_with("\xFF\xFE"sv)) return "UTF-16LE";
    if (bytes.starts_with("\xFE\xFF"sv)) return "UTF-16BE";
    const auto zero = [&](size_t i) { return i < bytes.size() && bytes[i] == 0; };
    if (bytes.size() >= 2 && zero(0) != zero(1)) {
        if (zero(1)) return zero(2) && zero(3) ? "UTF-32LE" : "UTF-16LE";
        return "UTF-16BE";
    }
    return zero(0) && zero(1) && zero(2) && bytes.size() >= 4 && !zero(3) ? "UTF-32BE" : "UTF-8";
}

std::string_view line_end_of(std::string_view bytes) {
    const size_t first = std::min(bytes.find_first_of("\r\n"), bytes.size());
    return bytes.substr(first, bytes.substr(first, 2) == "\r\n" ? 2 : 1);
}

std::string_view plain_text(const std::string& path, std::string_view bytes, std::string& store) {
    const std::string_view encoding = encoding_of(bytes);
    if (encoding != "UTF-8")
        throw input_error(path, 0,
                          "its text is written in " + std::string(encoding) + ", and UTF-8 is read: convert it");
    if (bytes.starts_with(kMark)) bytes.remove_prefix(kMark.size());
    if (bytes.find('\r') == std::string_view::npos) return bytes;
    return store = with_lf(bytes);
}

std::string plain_text(const std::string& path, std::string_view bytes) {
    std::string store;
    return std::string(plain_text(path, bytes, store));
}

std::string plain_text_of_utf16(const std::string& path, std::string_view bytes) {
    const std::string_view encoding = encoding_of(bytes);
    if (!encoding.starts_with("UTF-16")) return plain_text(path, bytes);
    return plain_text(path, utf8_of_utf16(bytes, encoding == "UTF-16BE"));
}

}  // namespace ambilux
