// Where a device reads textures from.
#pragma once

#include <cstdint>

namespace ambilux {

enum class TextureMemory : uint32_t {
    device,  ///< its own memory
    host,    ///< the host's; the driver copies pages to the device that are in use, as far as they fit there
    pinned,  ///< the host's, over the bus at every access
};

}  // namespace ambilux
