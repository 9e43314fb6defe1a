// libs: ambilux_formats ambilux_accel
// timeout: 60
// Surface points against wide arithmetic: their error bounds, normals, and the octahedral map.
#include <cmath>
#include <cstdio>

#include "scene/surface.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/bounds.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::accel_test;
using namespace ambilux::bounds;

namespace {

constexpr Features kShapes = {0, 0, kAllFeatures.primitives, false, false, false};

/// Triangles of all sizes and shapes, near and far: needles, slivers, large ones with one end at zero.
void random_triangle(Numbers& numbers, Vec3f (&p)[3]) {
    const float size = numbers.magnitude(-9, 9);
    const Vec3f base = numbers.chance(0.4f) ? Vec3f{0, 0, 0} : numbers.unit() * (size * numbers.magnitude(-3, 4));
    const Vec3f a = numbers.unit(), b = numbers.unit();
    p[0] = base;
    p[1] = base + a * size;
    p[2] = base +
           (numbers.chance(0.5f) ? b * (size * numbers.magnitude(-4, 0)) : (a + b * numbers.magnitude(-6, 0)) * size);
    if (numbers.chance(0.2f))
        for (Vec3f& v : p) v[int(numbers.index(3))] = 0;
}

Vec2f random_barycentrics(Numbers& numbers) {
    const std::vector<float> corners = corner_numbers();
    Vec2f b = {numbers.uniform(), numbers.uniform()};
    if (numbers.chance(0.5f)) b.x = corners[numbers.index(uint32_t(corners.size()))];
    if (numbers.chance(0.5f)) b.y = numbers.magnitude(-30, -1);
    if (b.x + b.y > 1) b.y = 1 - b.x;
    return b;
}

}  // namespace

TEST_CASE("A point of a triangle lies within p_error of its plane, and of the exact barycentric point") {
    Numbers numbers(1);
    Worst plane, point;
    for (int i = 0; i < 300000; ++i) {
        Vec3f p[3];
        random_triangle(numbers, p);
        Scene scene;
        MeshVertex vertices[3] = {{p[0]}, {p[1]}, {p[2]}};
        const Triangle triangle = {0, 1, 2, 0};
        const Shape shape = {0, kNone, 0, 0, 1, 0.0f};
        SceneView view = {};
        view.vertices = vertices;
        view.triangles = &triangle;
        view.shapes = &shape;
        view.triangle_count = 1;
        const Vec2f b = random_barycentrics(numbers);
        const SurfacePoint s = surface_at<kShapes>(view, 0, b.x, b.y);
        const Exact b1 = b.x, b2 = b.y, b0 = 1 - b1 - b2;
        const Exact3 exact = Exact3(p[0]) * b0 + Exact3(p[1]) * b1 + Exact3(p[2]) * b2;
        const Exact3 n = cross(Exact3(p[1]) - Exact3(p[0]), Exact3(p[2]) - Exact3(p[0]));
        // The box of p_error meets the plane.
        const double reach = double(dot(abs(n), Exact3(s.p_error))) + 0x1p-140 * norm(n);
        plane.add(std::fabs(double(dot(Exact3(s.p) - exact, n))), reach);
        // Each coordinate: the weight of the first vertex, 1 - b1 - b2, is rounded twice.
        for (int k = 0; k < 3; ++k)
            point.add(std::fabs(double(Exact3(s.p)[k] - exact[k])),
                      double(s.p_error[k]) + 2 * kUnit * std::fabs(double(p[0][k])) + 0x1p-140);
    }
    std::printf("triangle points: plane %.2f, coordinates %.2f of the bounds\n", plane.share, point.share);
    CHECK(plane.share <= 1);
    CHECK(point.share <= 1);
}

TEST_CASE(
    "The normal of a triangle is right to 6 roundings of its edges, to 3 over their sine of its corners, always unit") {
    Numbers numbers(2);
    Worst edges, corners;
    for (int i = 0; i < 300000; ++i) {
        Vec3f p[3];
        random_triangle(numbers, p);
        const Vec3f e1 = p[1] - p[0], e2 = p[2] - p[0];
        const Vec3f n = detail::triangle_normal(e1, e2);
        REQUIRE(std::fabs(norm(Exact3(n)) - 1) <= 6 * kUnit);
        const auto error = [&](Exact3 a, Exact3 b, double& sine) {
            const Exact3 c = cross(a, b);
            const double l = norm(c);
            sine = l > 0 ? l / (norm(a) * norm(b)) : 0;
            // Below, edges count as parallel.
            return sine * std::min(norm(a), norm(b)) > 0x1p-48 * std::max(norm(a), norm(b))
                       ? norm(Exact3(n) - c * (1 / Exact(l)))
                       : 0;
        };
        double sine;
        edges.add(error(Exact3(e1), Exact3(e2), sine), 6 * kUnit);
        const double whole = error(Exact3(p[1]) - Exact3(p[0]), Exact3(p[2]) - Exact3(p[0]), sine);
        if (sine > 8 * kUnit) corners.add(whole, (6 + 3 / sine) * kUnit);
    }
    // Axes, needles of 2^-47, edges that are exactly parallel or nothing.
    for (const Vec3f e2 :
         {Vec3f{0, 0x1p-47f, 0}, Vec3f{1, 0x1p-47f, 0}, Vec3f{0, 0, -0x1p-47f}, Vec3f{0x1p-47f, 0, 1}}) {
        const Vec3f e1 = {1, 0, 0}, n = detail::triangle_normal(e1, e2);
        const Exact3 c = cross(Exact3(e1), Exact3(e2));
        INFO(e2.x << " " << e2.y << " " << e2.z);
        CHECK(norm(Exact3(n) - c * (1 / Exact(norm(c)))) <= 6 * kUnit);
    }
    for (const float size : {1e-45f, 1e-30f, 1.0f, 1e25f, 3e37f})
        for (const Vec3f e2 : {Vec3f{2, 4, 6}, Vec3f{0, 0, 0}, Vec3f{-1e-45f, 0, 0}, Vec3f{1, 2, 3 + 1e-6f}}) {
            const Vec3f e1 = {1, 2, 3};
            for (const Vec3f n :
                 {detail::triangle_normal(e1 * size, e2 * size), detail::triangle_normal(e2 * size, e1 * size)})
                CHECK(std::fabs(norm(Exact3(n)) - 1) <= 6 * kUnit);
        }
    std::printf("triangle normals: %.2f of edges, %.2f of corners of the bounds\n", edges.share, corners.share);
    CHECK(edges.share <= 1);
    CHECK(corners.share <= 1);
}

TEST_CASE("A point of a sphere, disk or cylinder lies within p_error of it, at poles and rims, near and far") {
    Numbers numbers(3);
    for (const PrimitiveType type : {PrimitiveType::sphere, PrimitiveType::disk, PrimitiveType::cylinder}) {
        Worst worst, normal;
        for (int i = 0; i < 100000; ++i) {
            const float radius = numbers.magnitude(-9, 9), length = radius * numbers.magnitude(-3, 3);
            const Vec3f center =
                numbers.chance(0.3f) ? Vec3f{0, 0, 0} : numbers.unit() * (radius * numbers.magnitude(-4, 6));
            Scene scene;
            accel_test::add_quadric(scene, type, center, frame_from_normal(numbers.unit()), radius, length, i % 2);
            const Quadric& q = scene.quadrics[0];
            const std::vector<float> corners = corner_numbers();
            Vec2f c = {numbers.uniform(), numbers.uniform()};
            if (numbers.chance(0.5f)) c.x = corners[numbers.index(uint32_t(corners.size()))];
            if (numbers.chance(0.5f)) c.y = corners[numbers.index(uint32_t(corners.size()))];
            if (numbers.chance(0.1f)) c = {1, 0.5f};
            if (type == PrimitiveType::sphere) c = {2 * c.x - 1, 2 * c.y - 1};
            if (type == PrimitiveType::disk) c = square_to_disk(c);
            if (type == PrimitiveType::cylinder) c = {kPi * (2 * c.x - 1), c.y};
            const SurfacePoint s = surface_at<kShapes>(scene.view(), 0, c.x, c.y);
            // The surface itself: centre, radius and axis as floats have them.
            const auto column = [&](int k) {
                return Exact3(Vec3f{q.to_world.m[0][k], q.to_world.m[1][k], q.to_world.m[2][k]});
            };
            // The plane of a disk is that of its two axes, to which the third is orthogonal within rounding.
            const Exact3 axis = type == PrimitiveType::disk ? cross(column(0), column(1)) : column(2);
            const Exact3 f = Exact3(s.p) - Exact3(Vec3f{q.to_world.m[0][3], q.to_world.m[1][3], q.to_world.m[2][3]});
            const Exact3 along = axis * (dot(f, axis) / dot(axis, axis));
            const Exact3 n = type == PrimitiveType::sphere ? f : type == PrimitiveType::disk ? axis : f - along;
            const double l = norm(n);
            const double error =
                type == PrimitiveType::disk ? std::fabs(double(dot(f, axis))) / l : std::fabs(l - double(q.radius));
            // First order across the surface, and what steps along a curved one make of it.
            const double box = norm(Exact3(s.p_error)),
                         reach = double(dot(abs(n), Exact3(s.p_error))) / l + box * box / double(q.radius) + 0x1p-140;
            worst.add(error, reach);
            // Normals of points far from the origin are those of the local point, which knows nothing of that.
            const Exact3 ng = Exact3(s.ng) * (q.flip ? -1 : 1);
            normal.add(norm(ng - n * (1 / Exact(l))),
                       24 * kUnit + (type == PrimitiveType::disk ? 0 : box / double(q.radius)));
            REQUIRE(std::fabs(norm(Exact3(s.ng)) - 1) <= 6 * kUnit);
        }
        std::printf("quadric %d: points %.2f, normals %.2f of the bounds\n", int(type), worst.share, normal.share);
        CHECK(worst.share <= 1);
        CHECK(normal.share <= 1);
    }
}

TEST_CASE("The octahedral map and back moves a direction by 5e-7 at most, at its folds and corners too") {
    Numbers numbers(4);
    std::vector<Vec3f> directions = corner_directions();
    for (int i = 0; i < 300000; ++i) {
        Vec3f n = numbers.unit();
        // Next to the fold z = 0 and to the planes x = 0 and y = 0.
        if (i % 3 == 0) n[int(numbers.index(3))] *= numbers.magnitude(-30, -3);
        if (!is_zero(n)) directions.push_back(unit_of(n));
    }
    Worst worst, unit;
    for (const Vec3f n : directions) {
        const Vec2f e = octahedral_encode(n);
        REQUIRE((fabsf(e.x) <= 1.0f && fabsf(e.y) <= 1.0f));
        const Vec3f back = octahedral_decode(e);
        const Exact3 truth = Exact3(n) * (1 / Exact(norm(Exact3(n))));
        worst.add(norm(Exact3(back) - truth), 5e-7);
        unit.add(std::fabs(norm(Exact3(back)) - 1), 4 * kUnit);
    }
    std::printf("octahedral map: %.2f, lengths %.2f of the bounds\n", worst.share, unit.share);
    CHECK(worst.share <= 1);
    CHECK(unit.share <= 1);
}
