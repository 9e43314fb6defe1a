// libs: ambilux_render ambilux_integrators ambilux_backends ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Traversal on a CUDA device against the same traversal on the host: same rays, same hits (pitfall G12).
#include <cmath>
#include <map>
#include <vector>

#include "accel/cwbvh.h"
#include "accel/pair_bvh.h"
#include "backends/bench_rays.h"
#include "backends/cuda_device.h"
#include "backends/ray_batches.h"
#include "backends/trace_on_device.h"
#include "core/error.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"
#include "tests/support/disk_rays.h"
#include "tests/support/render_scene.h"
#include "tests/support/traversal_rays.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

bool no_device() {
    if (cuda_device_present()) return false;
    skip("no CUDA device: skipped");
    return true;
}

template <Features F, class Tracer>
std::vector<Hit> trace_on_host(const Scene& scene, const Tracer& tracer, const std::vector<Ray>& rays) {
    const SceneView view = scene.view();
    std::vector<Hit> hits(rays.size());
    detail::for_all(rays.size(), [&](size_t i) { tracer.template closest<F>(view, rays[i], hits[i]); });
    return hits;
}

struct Agreement {
    uint64_t rays = 0, hits = 0;
    uint64_t ties = 0;       ///< other primitive at the same distance
    uint64_t inexact = 0;    ///< other bits, or ties at distances that are equal only up to rounding
    uint64_t different = 0;  ///< hit, primitive or distance differs beyond rounding
    uint64_t occluded_different = 0;
};

bool same_float(float a, float b) { return float_bits(a) == float_bits(b) || (std::isnan(a) && std::isnan(b)); }

/// Device hits against the host's. A ray that no kernel wrote has a t that is not its tmax, and counts as different.
void compare(const Scene& scene, const std::vector<Ray>& rays, const std::vector<Hit>& host,
             const std::vector<Hit>& device, Agreement& a) {
    const SceneView view = scene.view();
    REQUIRE(device.size() == rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
        const Hit &h = host[i], &d = device[i];
        ++a.rays;
        a.hits += h.prim != kNone;
        if ((h.prim == kNone) != (d.prim == kNone)) {
            ++a.different;
        } else if (h.prim == kNone) {
            a.different += !same_float(d.t, rays[i].tmax);
        } else if (!(fabsf(h.t - d.t) <= t_tolerance(view, rays[i], h))) {
            ++a.different;
        } else if (h.prim != d.prim) {
            ++a.ties;
            a.inexact += h.t != d.t;
        } else {
            a.inexact += h.t != d.t || h.u != d.u || h.v != d.v;
        }
    }
}

/// Both kernels, nearest and any hit, on the first of `rays` for each count.
Agreement compare_all(const Scene& scene, const std::vector<Ray>& rays, const std::vector<size_t>& counts,
                      bool binary = false) {
    const std::vector<Hit> host = binary ? trace_on_host<kAllFeatures>(scene, PairAccel(scene).tracer(), rays)
                                         : trace_on_host<kAllFeatures>(scene, CwbvhAccel(scene).tracer(), rays);
    Agreement a;
    for (const size_t count : counts) {
        const std::vector<Ray> some(rays.begin(), rays.begin() + std::ptrdiff_t(count));
        for (const bool persistent : {false, true}) {
            compare(scene, some, host, trace_on_device(scene, some, false, persistent, binary), a);
            const std::vector<Hit> blocked = trace_on_device(scene, some, true, persistent, binary);
            REQUIRE(blocked.size() == count);
            for (size_t i = 0; i < count; ++i)
                a.occluded_different += (blocked[i].prim == kNone) != (host[i].prim == kNone);
        }
    }
    return a;
}

void check(const Agreement& a, bool exact) {
    INFO(a.rays << " rays, " << a.hits << " hits, " << a.ties << " ties, " << a.inexact << " inexact, " << a.different
                << " different, " << a.occluded_different << " other answers whether anything is hit");
    CHECK(a.hits > a.rays / 20);
    CHECK(double(a.different) <= 1e-5 * double(a.rays));
    CHECK(double(a.occluded_different) <= 1e-5 * double(a.rays));
    CHECK(double(a.ties) <= 1e-4 * double(a.rays));
    // The triangle test is made of operations that no compiler fuses, and both traversals visit primitives in one
    // order. But a lane that walks on before it has tested what it holds enters boxes that the host's shortened ray
    // misses by a rounding error: at an edge or a vertex another triangle may then be the first of those at the very
    // same distance. On the host, with rays that are never shortened, 5 of 12.6 million rays end so.
    if (exact) {
        CHECK(a.inexact == 0);
        CHECK(double(a.ties) <= 1.0 + 5e-7 * double(a.rays));
    }
}

constexpr uint32_t kMany = (1u << 20) + 1;
const std::vector<size_t> kCounts = {0, 1, 31, 32, 33, 1000, kMany};

}  // namespace

TEST_CASE("Device and host agree on triangles, with rays through edges and along surfaces (G12)") {
    if (no_device()) return;
    for (const float scale : {1e-4f, 1.0f, 1e4f}) {
        const Scene soup = triangle_soup(3000, 0.3f, scale, 7);
        check(compare_all(soup, test_rays(soup, 200000, scale, 31), {200000}), true);
    }
    Scene box;
    add_box(box, 1.0f, 16);
    check(compare_all(box, test_rays(box, 200000, 1.0f, 32), {200000}), true);
}

TEST_CASE("Device and host agree through a binary BVH (G12)") {
    if (no_device()) return;
    for (const float scale : {1e-4f, 1.0f, 1e4f}) {
        const Scene soup = triangle_soup(3000, 0.3f, scale, 7);
        check(compare_all(soup, test_rays(soup, 200000, scale, 31), {200000}, true), true);
    }
    Scene mixed = triangle_soup(500, 0.3f, 1.0f, 9);
    add_random_quadrics(mixed, 60, 1.0f, 6);
    check(compare_all(mixed, test_rays(mixed, kMany, 1.0f, 35), kCounts, true), false);
    Scene one;
    add_mesh(one, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    const std::vector<Hit> hits =
        trace_on_device(one, {{{0.25f, 0.25f, -1}, kInfinity, {0, 0, 1}, 0}}, false, true, true);
    CHECK(hits[0].t == 1.0f);
}

TEST_CASE("Device and host agree for any number of rays (G12)") {
    if (no_device()) return;
    Scene ball;
    add_ball(ball, {0, 0, 0}, 1.0f, 40, 0.1f, 3);
    check(compare_all(ball, test_rays(ball, kMany, 1.0f, 33), kCounts), true);
}

TEST_CASE("Of many rays, which warps take in longer runs, each is traced once (G12)") {
    if (no_device()) return;
    Scene ball;
    add_ball(ball, {0, 0, 0}, 1.0f, 40, 0.1f, 3);
    const std::vector<Ray> all = test_rays(ball, 6000077, 1.0f, 38);
    Agreement a;
    for (const size_t count : {size_t(3000001), all.size()}) {
        const std::vector<Ray> rays(all.begin(), all.begin() + std::ptrdiff_t(count));
        compare(ball, rays, trace_on_device(ball, rays, false, false, false),
                trace_on_device(ball, rays, false, true, false), a);
        const std::vector<Hit> one_by_one = trace_on_device(ball, rays, true, false, false),
                               persistent = trace_on_device(ball, rays, true, true, false);
        REQUIRE(persistent.size() == count);
        for (size_t i = 0; i < count; ++i)
            a.occluded_different += (one_by_one[i].prim == kNone) != (persistent[i].prim == kNone);
    }
    check(a, true);
}

TEST_CASE("Device and host agree on analytic shapes alone and among triangles (G12)") {
    if (no_device()) return;
    for (const float scale : {1e-4f, 1.0f, 1e4f}) {
        Scene quadrics;
        add_random_quadrics(quadrics, 60, scale, 5);
        check(compare_all(quadrics, test_rays(quadrics, 400000, scale, 34), {400000}), false);
    }
    Scene mixed = triangle_soup(500, 0.3f, 1.0f, 9);
    add_random_quadrics(mixed, 60, 1.0f, 6);
    check(compare_all(mixed, test_rays(mixed, kMany, 1.0f, 35), kCounts), false);
}

TEST_CASE("On a device a disk blocks no shadow ray that ends on it, and every one that goes through it") {
    if (no_device()) return;
    const DiskRays disk = rays_that_end_on_a_disk(200000, 51);
    for (const bool persistent : {false, true})
        for (const bool binary : {false, true}) {
            const std::vector<Hit> hits = trace_on_device(disk.scene, disk.rays, true, persistent, binary);
            REQUIRE(hits.size() == disk.rays.size());
            int different = 0;
            for (size_t i = 0; i < hits.size(); ++i) different += (hits[i].prim != kNone) != disk.behind[i];
            CHECK(different == 0);
        }
}

TEST_CASE("Device and host let the same rays pass surfaces of partial opacity (G12)") {
    if (no_device()) return;
    const bool with_quadrics = GENERATE(false, true);
    Scene scene = triangle_soup(2000, 0.3f, 1.0f, 10);
    if (with_quadrics) add_random_quadrics(scene, 30, 1.0f, 11);
    // A constant on even shapes, a checkerboard on odd ones. Half of the soup gets a shape of its own, so that
    // triangles have both.
    Texture checker = {};
    checker.type = TextureType::checkerboard;
    checker.to_uv[0][0] = checker.to_uv[1][1] = 4.0f;
    checker.color0 = {0.2f, 0.2f, 0.2f};
    checker.color1 = {0.9f, 0.9f, 0.9f};
    scene.textures.push_back(checker);
    scene.materials[0].opacity = {0.5f, -1};
    scene.materials.push_back({0, 0, 0, {1.0f, 0}});
    const uint32_t soup = uint32_t(scene.triangles.size());
    REQUIRE(scene.shapes[0].primitive_count == soup);
    for (Shape& shape : scene.shapes) shape.material = uint32_t(&shape - scene.shapes.data()) % 2;
    scene.shapes[0].primitive_count = soup / 2;
    scene.shapes.push_back({1, kNone, 0, soup / 2, soup - soup / 2, 0.0f});
    for (uint32_t i = soup / 2; i < soup; ++i) scene.triangles.edit()[i].shape = uint32_t(scene.shapes.size() - 1);
    scene.features.opacity = scene.features.textures = true;

    const std::vector<Ray> rays = test_rays(scene, 400000, 1.0f, 36);
    const CwbvhAccel accel(scene);
    Scene solid = scene;
    for (Material& material : solid.materials) material.opacity = {1.0f, -1};
    const CwbvhAccel solid_accel(solid);
    const std::vector<Hit> opaque =
        trace_on_host<Features{0, 0, kAllFeatures.primitives, false, false, false}>(solid, solid_accel.tracer(), rays);
    const std::vector<Hit> partial = trace_on_host<kAllFeatures>(scene, accel.tracer(), rays);
    uint64_t passed = 0;
    for (size_t i = 0; i < rays.size(); ++i) passed += opaque[i].prim != partial[i].prim;
    CHECK(passed > rays.size() / 10);  // opacity decides about many of these rays
    check(compare_all(scene, rays, {400000}), !with_quadrics);
}

TEST_CASE("On a device nothing is hit in an empty scene (G12)") {
    if (no_device()) return;
    const Scene empty;
    const std::vector<Ray> rays = test_rays(empty, 1000, 1.0f, 37);
    const Agreement a = compare_all(empty, rays, {0, 1, 33, 1000});
    CHECK(a.hits == 0);
    CHECK(a.different == 0);
    CHECK(a.occluded_different == 0);
}

TEST_CASE("All kernels of bench rays give the same answers (G12)") {
    if (no_device()) return;
    const Scene scene = project_scene("cornell");
    const std::string backend = GENERATE("cuda", "cuda-bvh2");
    const nlohmann::json json = bench_rays(scene, backend, 1);
    CHECK(json.at("device") == cuda_device_name());
    std::map<std::string, std::vector<double>> hit;
    for (const nlohmann::json& row : json.at("rows")) {
        CHECK(row.at("mrays_per_s") > 0.0);
        hit[row.at("batch")].push_back(row.at("hit"));
    }
    REQUIRE(hit.size() == 8);
    for (const auto& [batch, fractions] : hit) {
        INFO(batch);
        CHECK(fractions.size() == 3);
        CHECK(fractions[0] > 0.05);
        for (const double f : fractions) CHECK(f == fractions[0]);
    }
}

TEST_CASE("Without a device, its functions say so") {
    if (cuda_device_present()) return;
    CHECK(cuda_device_name().empty());
    const Scene empty;
    CHECK_THROWS_AS(trace_on_device(empty, {Ray{}}, false, true), Error);
    CHECK_THROWS_AS(bench_rays(empty, "cuda", 1), Error);
}
