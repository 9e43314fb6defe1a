#include "formats/document/numbers.h"

#include <cmath>

#include "core/text_cursor.h"

namespace ambilux::document {

double parse_number(const std::string& text, const Where& where, const std::string& what) {
    TextCursor cursor(text);
    cursor.skip_space();
    double value = 0;
    bool ok = cursor.number(value);
    cursor.skip_space();
    if (ok && !cursor.done()) ok = cursor.word() == "f";  // 0.5f, as Mitsuba 2 takes it
    cursor.skip_space();
    if (!ok || !cursor.done() || !std::isfinite(value)) fail(where, "'" + text + "' is not a number (" + what + ")");
    return value;
}

std::vector<double> parse_list(const std::string& text, const Where& where, const std::string& what) {
    std::vector<double> values;
    std::string token;
    const auto flush = [&] {
        if (!token.empty()) values.push_back(parse_number(token, where, what));
        token.clear();
    };
    for (char c : text) {
        if (c == ',' || std::isspace(static_cast<unsigned char>(c)))
            flush();
        else
            token += c;
    }
    flush();
    return values;
}

}  // namespace ambilux::document
