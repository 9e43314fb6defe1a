// Files packed by gzip.
#pragma once

#include <string>

#include "formats/limits.h"

namespace ambilux {

/// What is packed in `bytes`, or `bytes` themselves if they are no gzip file. Throws Error(bad_input) that names `path`
/// if they are broken or unpack to more than the limit.
std::string gunzip_if_packed(const std::string& path, std::string bytes, const Limits& limits);

}  // namespace ambilux
