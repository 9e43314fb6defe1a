// Files that are either complete or not there.
#pragma once

#include <string>
#include <string_view>

namespace ambilux {

/// Replaces the file at `path` with `bytes`: writes a temporary file beside it, flushes it to the disk, renames it. A
/// reader sees the old content or the new one, never a part, even after a crash. Throws Error(device) that names the
/// path and the system's reason; then the old file is unchanged.
void write_file_atomic(const std::string& path, std::string_view bytes);

/// Appends `text` with one write(2), so that lines of a killed process are whole or missing. Throws Error(device).
void append_file(const std::string& path, std::string_view text);

/// Whole content of a file. Throws Error(bad_input) that names the path and the system's reason.
std::string read_file(const std::string& path);

/// Makes a folder and those above it. Throws Error(device).
void make_folders(const std::string& path);

/// Fails now, not after hours of work, if `path` cannot be written: tests its folder with a temporary file. Throws
/// Error(device).
void check_writable(const std::string& path);

}  // namespace ambilux
