// Whether a scene fits on a device, before anything of it is there.
#pragma once

#include "scene/scene.h"
#include "scene/texture_memory.h"

namespace ambilux {

/// Bytes of a scene by what they are for.
struct SceneBytes {
    uint64_t geometry, textures, rest;

    uint64_t total() const { return geometry + textures + rest; }
};
/// `textures` on the host: they are not counted.
SceneBytes scene_bytes(const Scene& scene, TextureMemory textures);

/// Throws Error(device) with the bytes of geometry, textures, acceleration structure and the rest if together they are
/// more than `free` of the `total` bytes of `device`. Textures that lie on the host do not count.
void check_scene_fits(const Scene& scene, TextureMemory textures, uint64_t accel_bytes, uint64_t free, uint64_t total,
                      const std::string& device);

}  // namespace ambilux
