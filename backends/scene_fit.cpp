#include "backends/scene_fit.h"

#include <fmt/format.h>

#include "core/error.h"

namespace ambilux {
namespace {

uint64_t bytes_of(const auto& values) { return values.size() * sizeof values[0]; }

}  // namespace

SceneBytes scene_bytes(const Scene& scene, TextureMemory textures) {
    const uint64_t texels = bytes_of(scene.texels), geometry = bytes_of(scene.vertices) + bytes_of(scene.triangles) +
                                                               bytes_of(scene.quadrics) + bytes_of(scene.groups) +
                                                               bytes_of(scene.instances) + bytes_of(scene.sort_keys);
    return {geometry, textures == TextureMemory::device ? texels : 0, scene.memory_bytes() - geometry - texels};
}

void check_scene_fits(const Scene& scene, TextureMemory textures, uint64_t accel_bytes, uint64_t free, uint64_t total,
                      const std::string& device) {
    const bool on_device = textures == TextureMemory::device;
    const SceneBytes bytes = scene_bytes(scene, textures);
    const uint64_t without_texels = bytes.geometry + bytes.rest + accel_bytes, needed = bytes.total() + accel_bytes,
                   texels = bytes_of(scene.texels);
    if (needed <= free) return;
    // Rounded up, so that what does not fit never reads as if it did.
    const auto mib = [](uint64_t b) { return (b + (1 << 20) - 1) >> 20; };
    const bool helps = on_device && without_texels <= free;
    throw Error(
        ExitCode::device,
        fmt::format("this scene needs {} MiB on the device: {} of geometry, {} of textures{}, {} of acceleration "
                    "structure, {} of the rest; {} of {} MiB of {} are free. {}use --backend cpu",
                    mib(needed), mib(bytes.geometry), on_device ? mib(texels) : 0,
                    on_device ? "" : fmt::format(" (their {} lie on the host)", mib(texels)), mib(accel_bytes),
                    mib(bytes.rest), free >> 20, total >> 20, device,
                    helps ? "Keep its textures on the host with --textures host, make them smaller, or "
                          : "Make the scene smaller, or "));
}

}  // namespace ambilux
