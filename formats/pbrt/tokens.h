// Text of a pbrt file as tokens.
#pragma once

#include <string>
#include <string_view>

#include "formats/document/document.h"

namespace ambilux::pbrt {

using document::fail;
using document::Where;

enum class TokenKind { end, word, quoted, open, close };

struct Token {
    TokenKind kind = TokenKind::end;
    std::string text;  ///< without quotes and escapes
    int line = 0;
};

class Tokenizer {
public:
    /// `text` must outlive it.
    Tokenizer(std::string file, std::string_view text) : file_(std::move(file)), text_(text) {}

    const std::string& file() const { return file_; }
    Where where(const Token& token) const { return {file_, token.line}; }
    /// The next token, which stays the next one.
    const Token& peek();
    Token next();
    /// A string in quotes, or an error that says that `what` is missing.
    std::string quoted(const std::string& what);
    double number(const std::string& what);

private:
    Token scan();
    Token scan_quoted();

    std::string file_;
    std::string_view text_;
    size_t at_ = 0;
    int line_ = 1;
    bool has_next_ = false;
    Token next_;
};

/// False if `text` is no number.
bool parse_number(std::string_view text, double& value);

}  // namespace ambilux::pbrt
