// Files that are either complete or not there.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace ambilux {

/// Replaces the file at `path` with `bytes`: writes a temporary file beside it, flushes it to the disk, renames it. A
/// reader sees the old content or the new one, never a part, even after a crash. A symbolic link stays and what it
/// leads to is replaced; a device or a pipe is written to. A file without permission to write is refused, even to root.
/// Throws Error(device) that names the path and the system's reason; then the old file is unchanged.
void write_file_atomic(const std::string& path, std::string_view bytes);

/// Appends `text` with one write(2), so that lines of a killed process are whole or missing. Throws Error(device).
void append_file(const std::string& path, std::string_view text);

/// Whole content of a regular file of at most `most` bytes. Pipes and devices are refused: they need not end. Throws
/// Error(bad_input) that names the path and the reason.
std::string read_file(const std::string& path, uint64_t most = UINT64_MAX);

/// Makes a folder and those above it. Throws Error(device).
void make_folders(const std::string& path);

/// Fails now, not after hours of work, if write_file_atomic() could not write `path`. Makes nothing. Throws
/// Error(device).
void check_writable(const std::string& path);

/// Removes the temporary files of writes that are going on. For signal handlers that end the program.
void remove_unfinished_files();

}  // namespace ambilux
