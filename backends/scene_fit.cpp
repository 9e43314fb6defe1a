#include "backends/scene_fit.h"

#include <fmt/format.h>

#include "core/error.h"

namespace ambilux {
namespace {

template <class T>
uint64_t bytes_of(const std::vector<T>& values) {
    return values.size() * sizeof(T);
}

}  // namespace

void check_scene_fits(const Scene& scene, uint64_t accel_bytes, uint64_t free, uint64_t total,
                      const std::string& device) {
    const uint64_t needed = scene.memory_bytes() + accel_bytes;
    if (needed <= free) return;
    const uint64_t geometry = bytes_of(scene.vertices) + bytes_of(scene.triangles) + bytes_of(scene.quadrics) +
                              bytes_of(scene.groups) + bytes_of(scene.instances) + bytes_of(scene.sort_keys),
                   texels = bytes_of(scene.texels), rest = scene.memory_bytes() - geometry - texels;
    // Rounded up, so that what does not fit never reads as if it did.
    const auto mib = [](uint64_t bytes) { return (bytes + (1 << 20) - 1) >> 20; };
    throw Error(ExitCode::device,
                fmt::format("this scene needs {} MiB on the device: {} of geometry, {} of textures, {} of acceleration "
                            "structure, {} of the rest; {} of {} MiB of {} are free. Make its textures smaller, or use "
                            "--backend cpu",
                            mib(needed), mib(geometry), mib(texels), mib(accel_bytes), mib(rest), free >> 20,
                            total >> 20, device));
}

}  // namespace ambilux
