// libs: ambilux_backends
// timeout: 60
// A scene that does not fit on a device is refused with numbers.
#include "backends/scene_fit.h"
#include "core/error.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("what a scene needs is compared with what is free, and told part by part") {
    Scene scene;
    scene.vertices.resize((3 << 20) / sizeof(MeshVertex));
    scene.texels.resize(5 << 20);
    const uint64_t structure = 2 << 20, needed = scene.memory_bytes() + structure;
    CHECK_NOTHROW(check_scene_fits(scene, structure, needed, 1ull << 40, "device"));
    std::string message;
    try {
        check_scene_fits(scene, structure, needed - 1, 80ull << 30, "Device of 80 GiB");
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::device);
        message = e.what();
    }
    for (const char* part : {"needs 10 MiB", "3 of geometry", "5 of textures", "2 of acceleration structure",
                             "0 of the rest", "9 of 81920 MiB of Device of 80 GiB are free"}) {
        CAPTURE(part, message);
        CHECK(message.find(part) != std::string::npos);
    }
}
