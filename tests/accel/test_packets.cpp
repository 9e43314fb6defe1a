// libs: ambilux_formats ambilux_accel
// labels: accel
// Rays that Embree traces in packets have the hits of single rays: every number of them, whatever the lanes beside
// hold.
#include <cmath>
#include <cstring>
#include <vector>

#include "accel/embree_tracer.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

constexpr Features kShapes = {0, 0, kAllFeatures.primitives, false, false, false};
constexpr Features kMaskedShapes = {0, 0, kAllFeatures.primitives, false, false, true};
constexpr uint32_t kRays = 40000;

bool equal(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof(a)) == 0; }

/// Rays of all kinds: from anywhere, with an end, from a surface along it and away from it, and some that are none.
std::vector<Ray> mixed_rays(const Scene& scene, uint64_t seed) {
    Random random(seed);
    std::vector<Ray> rays;
    for (uint32_t i = 0; i < kRays; ++i) {
        Ray ray = {random.in_box(1.5f), kInfinity, random.direction(), i * 2654435761u};
        const Triangle t = scene.triangles[random.index(uint32_t(scene.triangles.size()))];
        const Vec3f a = scene.vertices[t.v0].p, b = scene.vertices[t.v1].p, c = scene.vertices[t.v2].p;
        switch (i % 8) {
            case 0: ray.tmax = random.uniform(); break;
            case 1: ray.o = a * 0.5f + b * 0.25f + c * 0.25f; break;
            case 2: ray = {a * 0.5f + b * 0.5f, kInfinity, normalize(b - a), i}; break;
            case 3:
                if (i % 5 == 0) ray.o[int(i / 8 % 3)] = NAN;
                if (i % 5 == 1) ray.d = {0, 0, 0};
                if (i % 5 == 2) ray.tmax = -1.0f;
                if (i % 5 == 3) ray.d[int(i / 8 % 3)] = kInfinity;
                break;
            default: break;
        }
        rays.push_back(ray);
    }
    return rays;
}

struct Difference {
    uint32_t closest = 0, occluded = 0, hits = 0, blocked = 0;
};

/// Packets of 1, 2, ... rays in turn against each ray alone. What lies behind the last result stays as it is.
template <Features F>
Difference compare(const Scene& scene, const EmbreeTracer& tracer, const std::vector<Ray>& rays, bool coherent) {
    const SceneView view = scene.view();
    Difference d;
    uint32_t count = 1;
    for (size_t first = 0; first + count <= rays.size(); first += count, count = count % kMostPacketRays + 1) {
        Hit hits[kMostPacketRays + 1];
        bool blocked[kMostPacketRays + 1];
        const Hit untouched = {-7.0f, -7.0f, -7.0f, 7};
        std::fill(std::begin(hits), std::end(hits), untouched);
        std::memset(blocked, 0x55, sizeof(blocked));
        tracer.closest<F>(view, &rays[first], count, coherent, hits);
        tracer.occluded<F>(view, &rays[first], count, coherent, blocked);
        unsigned char last;
        std::memcpy(&last, blocked + count, 1);
        if (!equal(hits[count], untouched) || last != 0x55) FAIL("written past " << count << " results");
        for (uint32_t k = 0; k < count; ++k) {
            Hit hit;
            const bool met = tracer.closest<F>(view, rays[first + k], hit);
            const bool any = tracer.occluded<F>(view, rays[first + k]);
            d.closest += !equal(hit, hits[k]);
            d.occluded += any != blocked[k];
            d.hits += met;
            d.blocked += any;
        }
    }
    return d;
}

template <Features F>
void check(const Scene& scene, uint64_t seed) {
    const EmbreeAccel accel(scene);
    const std::vector<Ray> rays = mixed_rays(scene, seed);
    for (const uint32_t width : {1u, 8u, 16u}) {
        EmbreeTracer tracer = accel.tracer();
        if (width > tracer.width) continue;
        tracer.width = width;
        for (const bool coherent : {false, true}) {
            const Difference d = compare<F>(scene, tracer, rays, coherent);
            INFO("width " << width << ", " << d.closest << " other hits, " << d.occluded << " other answers");
            CHECK(d.hits > kRays / 10);
            CHECK(d.hits < kRays * 9 / 10);
            CHECK(d.blocked > kRays / 10);
            // An eighth of the rays runs along an edge, where rounding decides which of two triangles is met.
            CHECK(d.closest <= (width == 1 ? 0 : kRays / 1000));
            CHECK(d.occluded <= (width == 1 ? 0 : kRays / 1000));
        }
    }
}

}  // namespace

TEST_CASE("Packets of every size have the hits of their rays alone") {
    Scene triangles = triangle_soup(2000, 0.3f, 1.0f, 7);
    check<kShapes>(triangles, 11);
    add_random_quadrics(triangles, 40, 1.0f, 5);
    check<kShapes>(triangles, 12);
}

TEST_CASE("Each ray of a packet passes surfaces of partial opacity by its own seed") {
    Scene scene = triangle_soup(2000, 0.3f, 1.0f, 8);
    add_random_quadrics(scene, 40, 1.0f, 6);
    for (Material& material : scene.materials) material.opacity = {0.5f, -1};
    scene.features.opacity = true;
    check<kMaskedShapes>(scene, 13);
}

TEST_CASE("A packet's end excludes what lies at it or beyond, ray by ray") {
    Scene scene;
    add_mesh(scene, {{-9, -9, 2}, {9, -9, 2}, {0, 9, 2}}, {0, 1, 2});
    const EmbreeAccel accel(scene);
    const SceneView view = scene.view();
    Ray rays[kMostPacketRays];
    for (uint32_t k = 0; k < kMostPacketRays; ++k)
        rays[k] = {{0.01f * float(k), 0, 0}, k % 2 ? 2.5f : 1.5f, {0, 0, 1}, k};
    Hit hits[kMostPacketRays];
    bool blocked[kMostPacketRays];
    accel.tracer().closest<kShapes>(view, rays, kMostPacketRays, true, hits);
    accel.tracer().occluded<kShapes>(view, rays, kMostPacketRays, true, blocked);
    for (uint32_t k = 0; k < kMostPacketRays; ++k) {
        CHECK((hits[k].prim != kNone) == (k % 2 == 1));
        CHECK(hits[k].t == (k % 2 ? 2.0f : 1.5f));
        CHECK(blocked[k] == (k % 2 == 1));
    }
}

TEST_CASE("Packets of rays that start on the plane of what they would meet first go on to what is behind it") {
    Scene scene;
    add_mesh(scene, {{-9, -9, 0}, {9, -9, 0}, {0, 9, 0}, {-9, -9, 3}, {9, -9, 3}, {0, 9, 3}}, {0, 1, 2, 3, 4, 5});
    const EmbreeAccel accel(scene);
    Ray rays[kMostPacketRays];
    for (uint32_t k = 0; k < kMostPacketRays; ++k) rays[k] = {{0.01f * float(k), 0, 0}, kInfinity, {0, 0, 1}, k};
    Hit hits[kMostPacketRays];
    accel.tracer().closest<kShapes>(scene.view(), rays, kMostPacketRays, false, hits);
    for (const Hit& hit : hits) {
        CHECK(hit.prim == 1);
        CHECK(hit.t == 3.0f);
    }
}
