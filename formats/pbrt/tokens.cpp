#include "formats/pbrt/tokens.h"

#include <charconv>
#include <cmath>

namespace ambilux::pbrt {

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
bool ends_word(char c) { return is_blank(c) || c == '"' || c == '[' || c == ']' || c == '#'; }

/// A character after a backslash; 0 if it stands for none.
char unescaped(char c) {
    switch (c) {
        case 'b': return '\b';
        case 'f': return '\f';
        case 'n': return '\n';
        case 'r': return '\r';
        case 't': return '\t';
        case '\\':
        case '\'':
        case '"': return c;
        default: return 0;
    }
}

}  // namespace

const Token& Tokenizer::peek() {
    if (!has_next_) next_ = scan();
    has_next_ = true;
    return next_;
}

Token Tokenizer::next() {
    peek();
    has_next_ = false;
    return std::move(next_);
}

Token Tokenizer::scan() {
    for (; at_ < text_.size(); ++at_) {
        const char c = text_[at_];
        if (c == '\n') ++line_;
        if (c == '#') {
            while (at_ + 1 < text_.size() && text_[at_ + 1] != '\n') ++at_;
        } else if (!is_blank(c)) {
            break;
        }
    }
    if (at_ == text_.size()) return {TokenKind::end, "", line_};
    const char c = text_[at_];
    if (c == '[' || c == ']') return ++at_, Token{c == '[' ? TokenKind::open : TokenKind::close, {c}, line_};
    if (c == '"') return scan_quoted();
    const size_t begin = at_;
    while (at_ < text_.size() && !ends_word(text_[at_])) ++at_;
    return {TokenKind::word, std::string(text_.substr(begin, at_ - begin)), line_};
}

Token Tokenizer::scan_quoted() {
    Token token{TokenKind::quoted, "", line_};
    for (++at_; at_ < text_.size(); ++at_) {
        const char c = text_[at_];
        if (c == '"') return ++at_, token;
        if (c == '\n') break;
        if (c != '\\') {
            token.text += c;
            continue;
        }
        if (++at_ == text_.size()) break;
        const char escaped = unescaped(text_[at_]);
        if (!escaped) fail(where(token), std::string("unknown escape '\\") + text_[at_] + "' in a string");
        token.text += escaped;
    }
    fail(where(token), "the string that begins here has no end");
}

std::string Tokenizer::quoted(const std::string& what) {
    Token token = next();
    if (token.kind != TokenKind::quoted) fail(where(token), what + " must be a string in quotes");
    return std::move(token.text);
}

double Tokenizer::number(const std::string& what) {
    const Token token = next();
    double value = 0;
    if (token.kind != TokenKind::word || !parse_number(token.text, value))
        fail(where(token), what + " must be a number" + (token.text.empty() ? "" : ", not '" + token.text + "'"));
    return value;
}

bool parse_number(std::string_view text, double& value) {
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

}  // namespace ambilux::pbrt
