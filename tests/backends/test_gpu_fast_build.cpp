// libs: ambilux_render ambilux_integrators ambilux_backends ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// The fast builder on a CUDA device: what the host builds, to the bit, and images of the good one.
#include <cstring>

#include "backends/cuda_device.h"
#include "backends/fast_cwbvh.h"
#include "core/error.h"
#include "render/renderer.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"
#include "tests/support/gpu_device.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

template <class T>
bool same(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

void check_same(const std::string& name, const Scene& scene) {
    INFO(name);
    const CwbvhArrays host = build_cwbvh_fast(scene.view());
    const FastOnDevice device = build_cwbvh_fast_on_device(scene);
    CHECK(device.arrays.depth == host.depth);
    CHECK(same(device.arrays.nodes, host.nodes));
    CHECK(same(device.arrays.primitives, host.primitives));
    CHECK(device.seconds > 0);
    CHECK(device.peak_bytes > host.bytes());
}

/// Triangles in no order, long ones among them, and shapes.
Scene mixed(uint32_t triangles, uint32_t quadrics, float scale) {
    Scene scene = triangle_soup(triangles, 0.05f, scale, triangles);
    Random random(6);
    for (uint32_t i = 0; i < triangles / 20; ++i) {
        const Vec3f a = random.in_box(scale), b = random.in_box(scale), thin = random.in_box(0.01f * scale);
        add_mesh(scene, {a, b, a + thin}, {0, 1, 2});
    }
    add_random_quadrics(scene, quadrics, scale, 5);
    return scene;
}

}  // namespace

TEST_CASE("A device builds what a host builds, to the bit") {
    if (!device()) return;
    check_same("nothing", Scene{});
    Scene one;
    add_mesh(one, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    check_same("one triangle", one);
    for (const float scale : {1e-4f, 1.0f, 1e4f}) check_same("mixed", mixed(20000, 30, scale));
    check_same("shapes alone", mixed(0, 60, 1.0f));
    check_same("a million", mixed(1000000, 0, 1.0f));
    Scene ball;
    add_ball(ball, {1000, 2000, -3000}, 10.0f, 60, 0.1f, 3);
    check_same("ball", ball);
    Scene equal;
    for (int i = 0; i < 5000; ++i) add_mesh(equal, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    check_same("equal triangles", equal);
    Scene broken;
    add_mesh(broken, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {NAN, 0, 0}, {kInfinity, 0, 0}}, {0, 1, 2, 0, 1, 3, 0, 4, 2});
    check_same("vertices that are no numbers", broken);
}

TEST_CASE("Images through the fast structure are those of the good one, but for rays through edges") {
    if (!device()) return;
    const Scene scene = project_scene("cornell", 64, 64);
    RenderSettings settings;
    settings.backend = Backend::cuda;
    settings.deterministic = true;
    const auto render = [&](Build build) {
        settings.build = build;
        const auto renderer = make_renderer(scene, settings);
        renderer->render(0, 16);
        const RenderStats stats = renderer->stats();
        CHECK(stats.settings.build == build);
        CHECK(stats.accel == "cwbvh");
        CHECK(stats.structure_seconds > 0);
        CHECK(stats.memory_bytes <= stats.memory_bytes_peak);
        return renderer->film();
    };
    const FilmMoments good = render(Build::good), fast = render(Build::fast);
    REQUIRE(good.sum.size() == fast.sum.size());
    size_t different = 0;
    for (size_t i = 0; i < good.sum.size(); ++i) different += good.sum[i] != fast.sum[i];
    CHECK(different < good.sum.size() / 50);
}

TEST_CASE("A budget that the fast builder does not keep is kept by the good one, where it may be chosen") {
    if (!device()) return;
    Scene scene = mixed(200000, 0, 1.0f);
    Sensor& s = scene.sensor;
    s.film_width = s.film_height = s.crop_width = s.crop_height = 64;
    RenderSettings settings;
    settings.backend = Backend::cuda;
    settings.build = Build::fast;
    settings.may_build_fast = true;
    settings.memory = scene.memory_bytes() + (uint64_t(34) << 20);
    CHECK(make_renderer(scene, settings)->stats().settings.build == Build::good);
    settings.may_build_fast = false;
    CHECK_THROWS_AS(make_renderer(scene, settings), Error);
}
