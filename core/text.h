// How the text of a file is written.
#pragma once

#include <string>
#include <string_view>

namespace ambilux {

/// UTF-8, UTF-16LE, UTF-16BE, UTF-32LE or UTF-32BE: by the byte order mark, or by the zeros of the first character.
std::string_view encoding_of(std::string_view bytes);

/// What ends the first line: LF, CR LF or CR. Headers of binary files end like that too, and data follow.
std::string_view line_end_of(std::string_view bytes);

/// The text without a byte order mark, each line ended by LF, whether the file has LF, CR LF or CR: a part of `bytes`,
/// or what `store` then holds. Throws Error(bad_input) that names the encoding if it is not UTF-8.
std::string_view plain_text(const std::string& path, std::string_view bytes, std::string& store);
std::string plain_text(const std::string& path, std::string_view bytes);

/// The same of a text in UTF-16 too, as XML may be.
std::string plain_text_of_utf16(const std::string& path, std::string_view bytes);

}  // namespace ambilux
