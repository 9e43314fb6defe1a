// libs: ambilux_formats ambilux_accel
// labels: accel
// timeout: 300
// Hit -> surface point -> next ray: the round trip, and that spawned rays do not meet what they leave (B33).
#include <cmath>
#include <vector>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

constexpr Features kTriangles = {0, 0, 1u, false, false, false};
constexpr Features kShapes = {0, 0, kAllFeatures.primitives, false, false, false};

Scene only(PrimitiveType type, float scale, Vec3f center, uint64_t seed) {
    Random random(seed);
    Scene scene;
    for (int i = 0; i < 30; ++i) {
        const Vec3f c = center + random.in_box(scale);
        if (type == PrimitiveType::triangle)
            add_mesh(scene, {c, c + random.in_box(scale), c + random.in_box(scale)}, {0, 1, 2});
        else
            add_quadric(scene, type, c, frame_from_normal(i % 3 ? random.direction() : Vec3f{0, 1, 0}),
                        scale * (0.05f + random.uniform()), scale * (0.1f + random.uniform()), i % 2);
    }
    return scene;
}

/// Distance of p from the exact surface, in double precision.
double distance_from(const Scene& scene, uint32_t prim, Vec3f p) {
    const SceneView view = scene.view();
    if (view.is_triangle(prim)) {
        const Triangle t = view.triangles[prim];
        const Vec3f a = view.vertices[t.v0].p, b = view.vertices[t.v1].p, c = view.vertices[t.v2].p;
        const double e1[3] = {double(b.x) - a.x, double(b.y) - a.y, double(b.z) - a.z},
                     e2[3] = {double(c.x) - a.x, double(c.y) - a.y, double(c.z) - a.z};
        const double n[3] = {e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2],
                             e1[0] * e2[1] - e1[1] * e2[0]};
        const double l = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        return std::fabs((double(p.x) - a.x) * n[0] + (double(p.y) - a.y) * n[1] + (double(p.z) - a.z) * n[2]) / l;
    }
    const Quadric& q = view.quadric(prim);
    const double f[3] = {double(p.x) - q.to_world.m[0][3], double(p.y) - q.to_world.m[1][3],
                         double(p.z) - q.to_world.m[2][3]};
    double z = 0, length2 = 0, axis2 = 0;
    for (int i = 0; i < 3; ++i)
        z += f[i] * q.to_world.m[i][2], axis2 += double(q.to_world.m[i][2]) * q.to_world.m[i][2],
            length2 += f[i] * f[i];
    z /= std::sqrt(axis2);
    if (q.type == PrimitiveType::sphere) return std::fabs(std::sqrt(length2) - q.radius);
    if (q.type == PrimitiveType::disk) return std::fabs(z);
    return std::fabs(std::sqrt(std::max(0.0, length2 - z * z)) - q.radius);
}

}  // namespace

TEST_CASE("Octahedral map is its own inverse") {
    Random random(3);
    for (int i = 0; i < 100000; ++i) {
        Vec3f n = random.direction();
        if (i % 10 == 0) n[i / 10 % 3] = 0.0f, n = normalize(n);
        const Vec2f e = octahedral_encode(n);
        REQUIRE(fabsf(e.x) <= 1.0f);
        REQUIRE(fabsf(e.y) <= 1.0f);
        REQUIRE(length(octahedral_decode(e) - n) < 5e-7f);
    }
    for (int axis = 0; axis < 3; ++axis)
        for (const float s : {1.0f, -1.0f}) {
            Vec3f n = {0, 0, 0};
            n[axis] = s;
            CHECK(octahedral_decode(octahedral_encode(n)) == n);
        }
}

TEST_CASE("A surface point lies on its surface within p_error, and where the ray met it") {
    for (const PrimitiveType type :
         {PrimitiveType::triangle, PrimitiveType::sphere, PrimitiveType::disk, PrimitiveType::cylinder})
        for (const float scale : {1e-4f, 1e-2f, 1.0f, 1e4f})
            for (const Vec3f center : {Vec3f{0, 0, 0}, Vec3f{3, -2, 5}}) {
                const Scene scene = only(type, scale, center * scale, 5);
                const SceneView view = scene.view();
                const CwbvhAccel accel(scene);
                Random random(6);
                int hits = 0;
                double worst = 0;
                for (int i = 0; i < 20000; ++i) {
                    const Ray ray = {center * scale + random.in_box(2 * scale), kInfinity, random.direction(), 0};
                    Hit hit;
                    if (!accel.tracer().closest<kShapes>(view, ray, hit)) continue;
                    ++hits;
                    const SurfacePoint s = surface_at<kShapes>(view, hit.prim, hit.u, hit.v);
                    const double bound = std::sqrt(double(length_squared(s.p_error)));
                    worst = std::max(worst, distance_from(scene, hit.prim, s.p) / bound);
                    // Along the ray the error grows with the distance and with the slope.
                    const float slope = max(fabsf(dot(s.ng, ray.d)), 1e-3f);
                    REQUIRE(length(ray.o + ray.d * hit.t - s.p) <= (1e-5f * scale) / slope);
                    REQUIRE(fabsf(length(s.ng) - 1) < 1e-5f);
                    REQUIRE(s.prim == hit.prim);
                    REQUIRE(s.shape == view.shape_of(hit.prim));
                    REQUIRE(fabsf(dot(normalize(s.dpdu), s.ng)) < 2e-3f);
                    if (view.is_triangle(hit.prim) || !is_zero(s.dpdv))
                        REQUIRE(fabsf(dot(normalize(s.dpdv), s.ng)) < 2e-3f);
                    if (!view.is_triangle(hit.prim)) {
                        // Right-handed, as Mitsuba has it, but for flipped normals and the disk, whose (r, phi) is
                        // right-handed too.
                        const float side =
                            dot(cross(s.dpdu, s.dpdv), s.ng) * (view.quadric(hit.prim).flip ? -1.0f : 1.0f);
                        if (type != PrimitiveType::sphere) REQUIRE(side >= 0.0f);
                    }
                }
                INFO("type " << int(type) << " scale " << scale);
                CHECK(hits > 500);
                CHECK(worst <= 1.0);
            }
}

TEST_CASE("Partial derivatives are those of the point by uv") {
    // Central differences through surface_at: move (u,v), see how p and uv move.
    Scene scene;
    add_mesh(scene, {{0, 0, 0}, {2, 0, 0.5f}, {0.3f, 1, 0}}, {0, 1, 2});
    set_uvs(scene, {{0.1f, 0.2f}, {0.9f, 0.3f}, {0.2f, 0.8f}});
    scene.shapes[0].flags = kShapeHasUvs;
    add_mesh(scene, {{0, 0, 0}, {2, 0, 0.5f}, {0.3f, 1, 0}}, {0, 1, 2});
    for (const PrimitiveType type : {PrimitiveType::sphere, PrimitiveType::disk, PrimitiveType::cylinder})
        add_quadric(scene, type, {1, 2, 3}, frame_from_normal(normalize(Vec3f{1, 2, 3})), 0.7f, 1.3f);
    const SceneView view = scene.view();
    Random random(9);
    for (uint32_t prim = 0; prim < view.primitive_count(); ++prim)
        for (int i = 0; i < 200; ++i) {
            const Vec4f r = random.next();
            float u = 0.1f + 0.3f * r.x, v = 0.1f + 0.3f * r.y;
            if (prim == 4) u = 0.2f + 2.5f * r.x;
            const float h = 1e-2f;
            const SurfacePoint c = surface_at<kAllFeatures>(view, prim, u, v);
            const SurfacePoint steps[2][2] = {
                {surface_at<kAllFeatures>(view, prim, u - h, v), surface_at<kAllFeatures>(view, prim, u + h, v)},
                {surface_at<kAllFeatures>(view, prim, u, v - h), surface_at<kAllFeatures>(view, prim, u, v + h)}};
            for (const auto& s : steps) {
                const Vec3f moved = s[1].p - s[0].p;
                const Vec2f duv = s[1].uv - s[0].uv;
                const Vec3f predicted = c.dpdu * duv.x + c.dpdv * duv.y;
                INFO("prim " << prim << " u " << u << " v " << v);
                REQUIRE(length(moved - predicted) < 2e-2f * length(moved) + 1e-5f);
            }
        }
}

TEST_CASE("Texture coordinates follow Mitsuba") {
    Scene scene;
    add_mesh(scene, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    const Frame upright = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    add_quadric(scene, PrimitiveType::sphere, {0, 0, 0}, upright, 2);
    add_quadric(scene, PrimitiveType::disk, {0, 0, 0}, upright, 2);
    add_quadric(scene, PrimitiveType::cylinder, {0, 0, 0}, upright, 2, 4);
    const SceneView view = scene.view();
    SurfacePoint s = surface_at<kShapes>(view, 0, 0.25f, 0.5f);
    CHECK(s.uv.x == 0.25f);
    CHECK(s.uv.y == 0.5f);
    const Vec2f e = octahedral_encode(normalize(Vec3f{0, -1, 1}));
    s = surface_at<kShapes>(view, 1, e.x, e.y);
    CHECK(s.uv.x == Approx(0.75f));
    CHECK(s.uv.y == Approx(0.25f));
    s = surface_at<kShapes>(view, 2, 0.0f, -0.5f);
    CHECK(s.uv.x == Approx(0.5f));
    CHECK(s.uv.y == Approx(0.75f));
    CHECK(s.p.y == Approx(-1.0f));
    s = surface_at<kShapes>(view, 3, -kPiOver2, 0.25f);
    CHECK(s.uv.x == Approx(0.75f));
    CHECK(s.uv.y == Approx(0.25f));
    CHECK(s.p.z == Approx(1.0f));
    CHECK(s.ng.y == Approx(-1.0f));
}

TEST_CASE("Normals: geometric side, interpolation, missing and zero vertex normals, flipped shapes") {
    Scene scene;
    add_mesh(scene, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    scene.shapes[0].flags = kShapeHasNormals;
    set_normals(scene, {normalize(Vec3f{1, 0, 1}), normalize(Vec3f{-1, 0, 1}), normalize(Vec3f{0, 1, 1})});
    SurfacePoint s = surface_at<kTriangles>(scene.view(), 0, 0.5f, 0.0f);
    CHECK(s.ng == Vec3f{0, 0, 1});
    CHECK(length(s.ns - Vec3f{0, 0, 1}) < 1e-6f);
    set_normals(scene, {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}});
    CHECK(surface_at<kTriangles>(scene.view(), 0, 0.2f, 0.2f).ns == Vec3f{0, 0, 1});
    Scene flipped;
    add_quadric(flipped, PrimitiveType::sphere, {0, 0, 0}, frame_from_normal({0, 0, 1}), 1, 1, true);
    s = surface_at<kShapes>(flipped.view(), 0, 0, 0);
    CHECK(s.p.z == Approx(1.0f));
    CHECK(s.ng.z == Approx(-1.0f));
    // Degenerate triangles still give unit normals and finite tangents.
    Scene flat;
    add_mesh(flat, {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3e-30f, 0, 0}, {0, 4e-30f, 0}}, {0, 1, 2, 0, 0, 0, 0, 3, 4});
    for (uint32_t i = 0; i < 3; ++i) {
        s = surface_at<kTriangles>(flat.view(), i, 0.3f, 0.3f);
        CHECK(length(s.ng) == Approx(1.0f));
        CHECK(is_finite(s.dpdu));
    }
    CHECK(surface_at<kTriangles>(flat.view(), 2, 0.3f, 0.3f).ng.z == Approx(1.0f));
}

TEST_CASE("Spawned rays do not meet the flat primitive they leave, nor the curved one from outside (B33)") {
    for (const PrimitiveType type :
         {PrimitiveType::triangle, PrimitiveType::sphere, PrimitiveType::disk, PrimitiveType::cylinder})
        for (const float scale : {1e-4f, 1.0f, 1e4f})
            for (const Vec3f center : {Vec3f{0, 0, 0}, Vec3f{30, -20, 50}}) {
                const Scene scene = only(type, scale, center * scale, 15);
                const SceneView view = scene.view();
                const EmbreeAccel embree(scene);
                const CwbvhAccel cwbvh(scene);
                Random random(16);
                int again = 0, again_embree = 0;
                for (int i = 0; i < 40000; ++i) {
                    const uint32_t prim = random.index(view.primitive_count());
                    const Vec4f r = random.next();
                    float u = r.x, v = r.y;
                    if (type == PrimitiveType::triangle && u + v > 1) u = 1 - u, v = 1 - v;
                    if (type == PrimitiveType::sphere) u = 2 * u - 1, v = 2 * v - 1;
                    if (type == PrimitiveType::disk) u = 0.7f * u, v = 0.7f * v;
                    if (type == PrimitiveType::cylinder) u = kPi * (2 * u - 1);
                    const SurfacePoint s = surface_at<kShapes>(view, prim, u, v);
                    Vec3f d = random.direction();
                    if (i % 4 == 0) d = normalize(d - s.ng * (dot(d, s.ng) * 0.999f));  // grazing
                    const bool curved = type == PrimitiveType::sphere || type == PrimitiveType::cylinder;
                    const Vec3f outward = view.is_triangle(prim) || !view.quadric(prim).flip ? s.ng : -s.ng;
                    if (curved && dot(d, outward) < 0) d = -d;
                    const Ray ray = {offset_ray_origin(s.p, s.p_error, s.ng, d), kInfinity, d, 0};
                    Hit hit;
                    again += cwbvh.tracer().closest<kShapes>(view, ray, hit) && hit.prim == prim;
                    again_embree += embree.tracer().closest<kShapes>(view, ray, hit) && hit.prim == prim;
                }
                INFO("type " << int(type) << " scale " << scale << " center " << center.x);
                CHECK(again == 0);
                CHECK(again_embree == 0);
            }
}

TEST_CASE("Rays leave a plane through zero, where the error bound across it is zero (B33)") {
    for (int axis = 0; axis < 3; ++axis) {
        const auto at = [axis](float a, float b) {
            Vec3f p = {0, 0, 0};
            p[(axis + 1) % 3] = a;
            p[(axis + 2) % 3] = b;
            return p;
        };
        Scene scene;
        add_mesh(scene, {at(-1, -1), at(1, -1), at(1, 1), at(-1, 1)}, {0, 1, 2, 0, 2, 3});
        const SceneView view = scene.view();
        const EmbreeAccel embree(scene);
        const CwbvhAccel cwbvh(scene);
        Random random(17);
        int again = 0, again_embree = 0;
        for (int i = 0; i < 20000; ++i) {
            Vec2f b = {random.uniform(), random.uniform()};
            if (b.x + b.y > 1) b = {1 - b.x, 1 - b.y};
            const SurfacePoint s = surface_at<kTriangles>(view, random.index(2), b.x, b.y);
            const Vec3f d = random.direction();
            const Ray ray = {offset_ray_origin(s.p, s.p_error, s.ng, d), kInfinity, d, 0};
            again += cwbvh.tracer().occluded<kTriangles>(view, ray);
            again_embree += embree.tracer().occluded<kTriangles>(view, ray);
        }
        INFO("axis " << axis);
        CHECK(again == 0);
        CHECK(again_embree == 0);
    }
}

TEST_CASE("Rays spawned inwards leave a sphere on its far side") {
    for (const float scale : {1e-4f, 1.0f, 1e4f}) {
        const Scene scene = only(PrimitiveType::sphere, scale, {0, 0, 0}, 25);
        Random random(26);
        const SceneView view = scene.view();
        for (int i = 0; i < 100000; ++i) {
            const uint32_t prim = random.index(view.primitive_count());
            const Quadric& q = view.quadric(prim);
            const Vec4f r = random.next();
            const SurfacePoint s = surface_at<kShapes>(view, prim, 2 * r.x - 1, 2 * r.y - 1);
            const Vec3f outward = q.flip ? -s.ng : s.ng;
            Vec3f d = random.direction();
            if (dot(d, outward) > 0) d = -d;
            const QuadricCrossings hits =
                quadric_crossings<kShapes>(q, offset_ray_origin(s.p, s.p_error, s.ng, d), d, kInfinity);
            const float chord = -2 * q.radius * dot(d, outward);
            REQUIRE(hits.count == 1);
            // An origin d inside the sphere lengthens a short chord up to sqrt(2 d r).
            REQUIRE(fabsf(hits.t[0] - chord) < 3e-3f * q.radius);
        }
    }
}
