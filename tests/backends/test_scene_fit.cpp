// libs: ambilux_backends
// timeout: 60
// A scene that does not fit on a device is refused with numbers.
#include "backends/scene_fit.h"
#include "core/error.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// 3 MiB of geometry and 5 of textures.
Scene small_scene() {
    Scene scene;
    scene.vertices.resize((3 << 20) / sizeof(MeshVertex));
    scene.texels.resize(5 << 20);
    return scene;
}
constexpr uint64_t kStructure = 2 << 20;

/// The message; empty if it fits.
std::string refusal(const Scene& scene, TextureMemory textures, uint64_t free) {
    try {
        check_scene_fits(scene, textures, kStructure, free, 80ull << 30, "Device of 80 GiB");
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::device);
        return e.what();
    }
    return {};
}

void check_parts(const std::string& message, std::initializer_list<const char*> parts) {
    for (const char* part : parts) {
        CAPTURE(part, message);
        CHECK(message.find(part) != std::string::npos);
    }
}

}  // namespace

TEST_CASE("what a scene needs is compared with what is free, and told part by part") {
    const Scene scene = small_scene();
    const uint64_t needed = scene.memory_bytes() + kStructure;
    CHECK(refusal(scene, TextureMemory::device, needed).empty());
    check_parts(refusal(scene, TextureMemory::device, needed - 1),
                {"needs 10 MiB", "3 of geometry", "5 of textures", "2 of acceleration structure", "0 of the rest",
                 "9 of 81920 MiB of Device of 80 GiB are free", "--textures host"});
}

TEST_CASE("geometry is vertices, primitives and what places them; what is no texture beside is the rest") {
    Scene scene;
    uint64_t geometry = 0;
    const auto check = [&](uint64_t textures, uint64_t rest) {
        const SceneBytes bytes = scene_bytes(scene, TextureMemory::device);
        CHECK(bytes.geometry == geometry);
        CHECK(bytes.textures == textures);
        CHECK(bytes.rest == rest);
        CHECK(bytes.total() == scene.memory_bytes());
    };
    const auto add = [&](auto& values, size_t count) {
        values.resize(count);
        geometry += count * sizeof(values[0]);
        check(0, 0);
    };
    add(scene.vertices, 2);
    add(scene.triangles, 3);
    add(scene.quadrics, 5);
    add(scene.groups, 7);
    add(scene.instances, 11);
    add(scene.sort_keys, 13);
    scene.texels.resize(17);
    check(17, 0);
    scene.emitters.resize(19);
    check(17, 19 * sizeof(Emitter));
    CHECK(scene_bytes(scene, TextureMemory::pinned).textures == 0);
    CHECK(scene_bytes(scene, TextureMemory::host).total() == scene.memory_bytes() - 17);
}

TEST_CASE("textures on the host do not count, and are not offered where they do not help") {
    const Scene scene = small_scene();
    const uint64_t needed = scene.memory_bytes() + kStructure - scene.texels.size();
    for (const TextureMemory host : {TextureMemory::host, TextureMemory::pinned}) {
        CHECK(refusal(scene, host, needed).empty());
        check_parts(refusal(scene, host, needed - 1),
                    {"needs 5 MiB", "0 of textures (their 5 lie on the host)", "use --backend cpu"});
        CHECK(refusal(scene, host, needed - 1).find("--memory") == std::string::npos);
    }
    CHECK(refusal(scene, TextureMemory::device, needed).find("--textures host") != std::string::npos);
    CHECK(refusal(scene, TextureMemory::device, needed - 1).find("--textures host") == std::string::npos);
}
