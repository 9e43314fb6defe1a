// libs: ambilux_backends ambilux_formats ambilux_accel
// labels: accel
// The fast builder's steps, and what its trees hold. That rays find the same in them as in others:
// tests/accel/test_accel_agree.cpp.
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "backends/cpu/primitives.h"
#include "backends/fast_build.h"
#include "backends/fast_cwbvh.h"
#include "core/error.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

bool same(const CwbvhArrays& a, const CwbvhArrays& b) {
    return a.nodes.size() == b.nodes.size() && a.primitives.size() == b.primitives.size() && a.depth == b.depth &&
           std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.size() * sizeof(CwbvhNode)) == 0 &&
           std::memcmp(a.primitives.data(), b.primitives.data(), a.primitives.size() * sizeof(CwbvhPrimitive)) == 0;
}

/// Box of a child in world space.
Bounds3f child_box(const CwbvhNode& n, int slot) {
    const auto bytes = [&](const uint32_t(&words)[2]) { return float(words[slot / 4] >> 8 * (slot % 4) & 255u); };
    const Vec3f step = {bits_float(n.scale_xz & 0x7f800000u) * 0x1p-15f, n.scale_y * 0x1p-15f,
                        bits_float(n.scale_xz << 16) * 0x1p-15f};
    const Vec3f corner = {n.p[0], n.p[1], n.p[2]};
    return {corner + step * Vec3f{bytes(n.lower_x), bytes(n.lower_y), bytes(n.lower_z)},
            corner + step * Vec3f{bytes(n.upper_x), bytes(n.upper_y), bytes(n.upper_z)}};
}

bool meets(const Bounds3f& b, Vec3f p) {
    const Vec3f slack = max(abs(b.lower), abs(b.upper)) * 1e-5f;
    for (int axis = 0; axis < 3; ++axis)
        if (p[axis] < b.lower[axis] - slack[axis] || p[axis] > b.upper[axis] + slack[axis]) return false;
    return true;
}

/// Leaves below node `at` that hold triangle `prim`, on ways through boxes that hold `p`.
int leaves_at(const CwbvhArrays& a, uint32_t at, uint32_t prim, Vec3f p) {
    const CwbvhNode& n = a.nodes[at];
    int found = 0;
    uint32_t child = n.first_child, primitive = n.first_primitive;
    for (int slot = 0; slot < 8; ++slot) {
        const bool inner = n.valid >> (24 + slot) & 1u, met = meets(child_box(n, slot), p);
        if (inner && met) found += leaves_at(a, child, prim, p);
        child += inner;
        const uint32_t end = primitive + uint32_t(detail::count_bits(n.valid >> 3 * slot & 7u));
        for (; primitive < end; ++primitive) found += met && a.primitives[primitive].prim<kAllFeatures>() == prim;
    }
    return found;
}

/// Long thin triangles across a room full of small ones.
Scene beams() {
    Scene scene = triangle_soup(2000, 0.02f, 1.0f, 5);
    Random random(6);
    for (int i = 0; i < 100; ++i) {
        const Vec3f a = random.in_box(1), b = random.in_box(1), thin = random.in_box(0.01f);
        add_mesh(scene, {a, b, a + thin}, {0, 1, 2});
    }
    return scene;
}

}  // namespace

TEST_CASE("A tree is the same on one thread as on all") {
    const Scene scene = beams();
    CwbvhArrays alone;
    tbb::task_arena(1).execute([&] { alone = build_cwbvh_fast(scene.view()); });
    for (int i = 0; i < 3; ++i) CHECK(same(build_cwbvh_fast(scene.view()), alone));
}

TEST_CASE("Every point of a triangle lies in a leaf that holds it, and each is stored once") {
    const Scene scene = beams();
    const CwbvhArrays arrays = build_cwbvh_fast(scene.view());
    const size_t triangles = scene.triangles.size();
    CHECK(arrays.primitives.size() == triangles);
    Random random(7);
    for (uint32_t prim = 0; prim < triangles; ++prim) {
        const Triangle t = scene.triangles[prim];
        for (int i = 0; i < 4; ++i) {
            float u = random.uniform(), v = random.uniform();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const Vec3f p =
                scene.vertices[t.v0].p * (1 - u - v) + scene.vertices[t.v1].p * u + scene.vertices[t.v2].p * v;
            if (leaves_at(arrays, 0, prim, p) == 0)
                FAIL("triangle " << prim << " at " << p.x << " " << p.y << " " << p.z);
        }
    }
}

TEST_CASE("Codes interleave the bits of cells") {
    const fast::Grid grid = fast::grid_over({{-1, -1, -1}, {1, 1, 1}});
    const auto code = [&](Vec3f p) { return fast::morton_code(grid, {p, p}); };
    CHECK(code({-1, -1, -1}) == 0);
    CHECK(code({1, 1, 1}) == (uint64_t(1) << 63) - 1);
    CHECK(code({0.5f, -0.5f, -0.5f}) >> 60 == 4);
    CHECK(code({-0.5f, 0.5f, -0.5f}) >> 60 == 2);
    CHECK(code({-0.5f, -0.5f, 0.5f}) >> 60 == 1);
    for (uint32_t bit = 0; bit < 21; ++bit) CHECK(fast::spread(1u << bit) == uint64_t(1) << 3 * bit);
    // A box over nothing, and one without extent.
    CHECK(fast::morton_code(fast::grid_over({}), {{0, 0, 0}, {1, 1, 1}}) == 0);
    CHECK(fast::morton_code(fast::grid_over({{3, 3, 3}, {3, 3, 3}}), {{3, 3, 3}, {3, 3, 3}}) == 0);
}

TEST_CASE("Grids are the exact logarithm's") {
    for (int e = -120; e < 120; ++e) {
        CHECK(collapse::power_of_two(e) == std::ldexp(1.0, e));
        CHECK(collapse::ceil_log2(std::ldexp(1.0, e)) == e);
        CHECK(collapse::ceil_log2(std::nextafter(std::ldexp(1.0, e), 1e300)) == e + 1);
        CHECK(collapse::ceil_log2(std::nextafter(std::ldexp(1.0, e), 0.0)) == e);
    }
}

TEST_CASE("Boxes that grow along the curve and boxes that are all equal end in few rounds and shallow trees") {
    // Each is best joined with the one before it, which has a better one.
    Scene growing;
    double x = 0;
    for (int i = 0; i < 3000; ++i) {
        const double size = 1e-3 * std::pow(1.004, i);
        add_mesh(growing, {{float(x), 0, 0}, {float(x + size), 0, 0}, {float(x), float(size), float(size)}}, {0, 1, 2});
        x += size;
    }
    CHECK(build_cwbvh_fast(growing.view()).depth <= 24);
    Scene equal;
    for (int i = 0; i < 5000; ++i) add_mesh(equal, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    const CwbvhArrays arrays = build_cwbvh_fast(equal.view());
    CHECK(arrays.depth <= 12);
    CHECK(arrays.primitives.size() == 5000);
}

TEST_CASE("The bytes of a build grow with its primitives, and are those of its memory") {
    const PrimitiveBytes bytes = host_primitive_bytes();
    for (const uint32_t n : {0u, 1u, 1000u, 1000000u}) {
        Layout dry;
        FastBuildMemory::lay_out(dry, n, bytes);
        CHECK(fast_build_peak_bytes(n, bytes) >= dry.bytes() + n * sizeof(CwbvhPrimitive));
        CHECK(fast_build_peak_bytes(n, bytes) <= 250 * uint64_t(n) + (1 << 20));
    }
    const Scene scene = beams();
    const CwbvhArrays arrays = build_cwbvh_fast(scene.view());
    Layout dry;
    FastBuildMemory::lay_out(dry, scene.view().primitive_count(), bytes);
    CHECK(dry.bytes() + arrays.bytes() <= fast_build_peak_bytes(scene.view().primitive_count(), bytes));
}

TEST_CASE("A tree that is too deep is refused, and the message names the setting") {
    FastBuild build;
    build.depth = uint32_t(kCwbvhStackSize);
    CHECK_NOTHROW(check_depth(build));
    ++build.depth;
    CHECK_THROWS_WITH(check_depth(build), ContainsSubstring("build=good"));
}
