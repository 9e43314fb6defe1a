// libs: ambilux_scene ambilux_core
// timeout: 60
// Densities of light sampling and of emission against double precision: near and far, grazing, on the surface.
#include <cmath>
#include <cstdio>

#include "tests/support/bounds.h"
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/emitter/emission.h"

using namespace ambilux;
using namespace ambilux::bounds;
using namespace ambilux::test;

namespace {

constexpr Features kAll = kAllFeatures;

Vec4f four(Numbers& numbers) {
    static const std::vector<float> corners = corner_numbers();
    Vec4f u = {0, numbers.uniform(), numbers.uniform(), numbers.uniform()};
    if (numbers.chance(0.3f)) u.y = corners[numbers.index(uint32_t(corners.size()))];
    if (numbers.chance(0.3f)) u.z = corners[numbers.index(uint32_t(corners.size()))];
    return u;
}

}  // namespace

TEST_CASE("Densities of points on area lights are right to 8 roundings and 4 over the cosine there") {
    Numbers numbers(1);
    Worst worst, same;
    int lit = 0;
    for (const PrimitiveType type : {PrimitiveType::triangle, PrimitiveType::disk, PrimitiveType::cylinder})
        for (int i = 0; i < 300; ++i) {
            const float size = numbers.magnitude(-6, 6);
            const Vec3f origin = numbers.unit(-9) * (size * numbers.magnitude(-3, 2));
            Scene scene;
            if (type == PrimitiveType::triangle)
                add_area(
                    scene,
                    add_rectangle(scene, origin, Vec3f{size, 0, 0}, Vec3f{0, size * numbers.magnitude(-3, 0), 0}, 3),
                    splat(1));
            else
                add_area(scene,
                         test::add_quadric(scene, type, size,
                                           type == PrimitiveType::disk ? size : size * numbers.magnitude(-3, 1),
                                           numbers.unit(-9), origin),
                         splat(1));
            complete(scene);
            const SceneView view = view_of(scene);
            for (int k = 0; k < 200; ++k) {
                const Vec3f p = origin + numbers.unit(-9) * (size * numbers.magnitude(-4, 4));
                EmitterSample s;
                if (!sample_emitter_direct<kAll>(view, p, four(numbers), s)) continue;
                ++lit;
                const Exact3 to = Exact3(s.p) - Exact3(p);
                const double d2 = double(dot(to, to)), d = std::sqrt(d2), cosine = -double(dot(to, Exact3(s.ng))) / d;
                if (!(cosine > 1e-6)) continue;
                const double position = area_pdf_position(view, scene.emitters[0], s.prim);
                worst.add(std::fabs(s.pdf_sa - position * d2 / cosine) / s.pdf_sa, (8 + 4 / cosine) * kUnit);
                SurfacePoint hit = {};
                hit.p = s.p, hit.ng = s.ng, hit.prim = s.prim;
                REQUIRE(pdf_emitter_direct<kAll>(view, 0, p, s.wi, hit) == s.pdf_sa);
                REQUIRE(std::fabs(norm(Exact3(s.wi)) - 1) <= 6 * kUnit);
            }
        }
    std::printf("area densities: %d, %.2f of the bound\n", lit, worst.share);
    CHECK(lit > 20000);
    CHECK(worst.share <= 1);
}

TEST_CASE("Densities of spheres seen from outside are right to 12 roundings and 8 over the cosine of the cone") {
    Numbers numbers(2);
    Worst worst, on;
    for (int i = 0; i < 2000; ++i) {
        const float radius = numbers.magnitude(-6, 6);
        const Vec3f center =
            numbers.chance(0.5f) ? Vec3f{0, 0, 0} : numbers.unit(-9) * (radius * numbers.magnitude(-3, 1));
        Scene scene;
        add_area(scene, add_sphere(scene, center, radius), splat(1));
        complete(scene);
        const SceneView view = view_of(scene);
        for (int k = 0; k < 100; ++k) {
            const Vec3f p = center + numbers.unit(-9) * (radius * (1 + numbers.magnitude(-6, 6)));
            EmitterSample s;
            if (!sample_emitter_direct<kAll>(view, p, four(numbers), s)) continue;
            const Exact3 to = Exact3(center) - Exact3(p);
            const double sin2 = double(radius) * double(radius) / double(dot(to, to));
            if (sin2 >= 1 - 1e-6 || s.pdf_sa > 1e30f) continue;
            const double cosine = std::sqrt(1 - sin2), truth = 1 / (2 * M_PI * (sin2 / (1 + cosine)));
            worst.add(std::fabs(s.pdf_sa - truth) / truth, (12 + 8 / cosine) * kUnit);
            SurfacePoint hit = {};
            hit.p = s.p, hit.ng = s.ng, hit.prim = s.prim;
            if (-dot(s.ng, s.wi) > 0.0f) REQUIRE(pdf_emitter_direct<kAll>(view, 0, p, s.wi, hit) == s.pdf_sa);
            // The sampled point: on the sphere, and where the direction says.
            on.add(std::fabs(norm(Exact3(s.p) - Exact3(center)) - double(radius)), norm(Exact3(s.p_error)));
        }
    }
    std::printf("sphere densities: %.2f, points %.2f of the bounds\n", worst.share, on.share);
    CHECK(worst.share <= 1);
    CHECK(on.share <= 1);
}

TEST_CASE("The density of emission at a sampled direction is the sampled one, to 16 roundings of a cosine of 1") {
    Numbers numbers(3);
    Worst worst;
    for (int i = 0; i < 400; ++i) {
        Scene scene;
        add_area(scene, test::add_quadric(scene, PrimitiveType::disk, 2, 2, numbers.unit(), {1, 2, 3}), splat(1));
        complete(scene);
        const SceneView view = view_of(scene);
        for (int k = 0; k < 300; ++k) {
            const Vec4f u = four(numbers), v = four(numbers);
            EmissionSample s;
            if (!sample_emission<kAll>(view, u, {v.y, v.z}, s)) continue;
            const float pdf = pdf_emission_direction<kAll>(view, 0, s.ng, s.d);
            worst.add(std::fabs(double(pdf) - s.pdf_dir), 16 * kUnit * double(kInvPi));
            REQUIRE(s.pdf_dir == s.cos_theta * kInvPi);
            REQUIRE(std::fabs(norm(Exact3(s.d)) - 1) <= 16 * kUnit);
        }
    }
    std::printf("emission: %.2f of the bound\n", worst.share);
    CHECK(worst.share <= 1);
}

TEST_CASE("Emitters of a point: direction, distance and fall-off to 5 roundings, from 1e-9 to 1e9") {
    Numbers numbers(4);
    Worst distance, light;
    for (int i = 0; i < 50000; ++i) {
        Scene scene;
        Emitter& e = add_emitter(scene, EmitterType::point, splat(1));
        e.position = numbers.vector(-9, 9);
        complete(scene);
        const Vec3f p = e.position + numbers.unit(-6) * numbers.magnitude(-9, 9);
        const Exact3 to = Exact3(scene.emitters[0].position) - Exact3(p);
        if (double(dot(to, to)) == 0) continue;
        EmitterSample s;
        REQUIRE(sample_emitter_direct<kAll>(view_of(scene), p, {0, 0.5f, 0.5f, 0.5f}, s));
        const double d = norm(to);
        distance.add(std::fabs(s.distance - d) / d, 4 * kUnit);
        light.add(std::fabs(s.radiance.x - 1 / (d * d)) * d * d, 10 * kUnit);
        REQUIRE(norm(Exact3(s.wi) - to * (1 / Exact(d))) <= 6 * kUnit);
        REQUIRE((s.delta && s.pdf_sa == scene.emitters[0].pick_probability));
    }
    std::printf("point: distance %.2f, light %.2f of the bounds\n", distance.share, light.share);
    CHECK(distance.share <= 1);
    CHECK(light.share <= 1);
}
