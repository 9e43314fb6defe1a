// EXT_meshopt_compression: buffer views whose bytes are packed (Kapoulkine 2021, the extension's text).
#pragma once

#include <string>
#include <string_view>

#include "formats/gltf/model.h"

namespace ambilux::gltf {

/// The JSON of a file in text or in binary; empty where there is none.
std::string_view json_part(std::string_view bytes);

/// The same file for a reader that does not know the extension: buffers that stand for what is packed, and have no
/// bytes of their own, get one byte.
std::string with_fallback_buffers(const std::string& bytes);

/// Unpacks the views of the model into buffers of their own. Throws Error(bad_input).
void unpack_views(Context& context);

}  // namespace ambilux::gltf
