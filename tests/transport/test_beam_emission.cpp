// libs: ambilux_scene ambilux_core
// Emitters that light subpaths alone carry: their power, where and how their light leaves, and that nothing else meets
// it.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/emitter/emission.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features F = kAllFeatures;

Emitter& add_directional_area(Scene& s, uint32_t shape, Rgb radiance) {
    Emitter& e = add_area(s, shape, radiance);
    e.type = EmitterType::directional_area;
    return e;
}

/// A beam, a mesh of a triangle and a larger one, a sphere.
Scene scene_of(int kind) {
    Scene s;
    if (kind == 0) {
        Emitter& e = add_emitter(s, EmitterType::collimated, {3, 2, 1});
        e.position = {1, 2, 3};
        e.direction = normalize(Vec3f{1, 0, -2});
    } else if (kind == 1) {
        add_directional_area(s, add_mesh(s, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 3}}, {{0, 1, 2}, {0, 1, 3}}),
                             {3, 2, 1});
    } else {
        add_directional_area(s, add_sphere(s, {0.5f, 1, 3}, 0.7f), {3, 2, 1});
    }
    complete(s);
    if (kind == 1) {
        // Tables of meshes are made for area emitters here: those of the shape, under the name of one.
        s.emitters[0].type = EmitterType::area;
        complete(s);
        s.emitters[0].type = EmitterType::directional_area;
    }
    return s;
}

}  // namespace

TEST_CASE("power and directions of beams") {
    const double areas[] = {1, 0.5 + 1.5, 4 * M_PI * 0.49};
    for (int kind = 0; kind < 3; ++kind) {
        INFO(kind);
        const Scene scene = scene_of(kind);
        const SceneView view = view_of(scene);
        const bool point = kind == 0;
        double power = 0, lower = 0;
        const uint32_t n = 100000;
        int wrong = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const Vec4f a = random(1, i), b = random(1, i, 1);
            EmissionSample s;
            REQUIRE(sample_emission<F>(view, a, {b.x, b.y}, s));
            power += double(s.radiance.x) * s.cos_theta / (double(s.pick) * s.pdf_pos * s.pdf_dir) / n;
            wrong += s.cos_theta != 1 || s.pdf_dir != 1 || pdf_emission_direction<F>(view, 0, s.ng, s.d) != 1;
            wrong += s.prim != kNone || s.infinite || !s.delta_direction || s.delta_position != point;
            wrong += std::fabs(length(s.d) - 1) > 1e-6f || length(s.d - s.ng) > 1e-6f;
            if (kind == 0) wrong += length(s.p - Vec3f{1, 2, 3}) > 0 || length(s.d - scene.emitters[0].direction) > 0;
            if (kind == 1) {
                lower += s.d.z == 1;
                wrong += !(s.d.z == 1 && std::fabs(s.p.z) < 1e-5f) && !(s.d.y == -1 && std::fabs(s.p.y) < 1e-5f);
            }
            if (kind == 2) wrong += length(s.p - (Vec3f{0.5f, 1, 3} + s.d * 0.7f)) > 1e-5f;
        }
        CHECK(wrong == 0);
        CHECK(power == Approx(3 * areas[kind]).epsilon(1e-5));
        // A quarter of the area: binomial.
        if (kind == 1) CHECK(std::fabs(lower / n - 0.25) < 4.5 * std::sqrt(0.25 * 0.75 / n));
    }
}

TEST_CASE("no sample towards a beam has light, and no ray that meets its shape") {
    for (int kind = 0; kind < 3; ++kind) {
        const Scene scene = scene_of(kind);
        const SceneView view = view_of(scene);
        for (uint32_t i = 0; i < 1000; ++i) {
            const Vec4f a = random(2, i), b = random(2, i, 1);
            EmitterSample s;
            CHECK_FALSE(sample_emitter_direct<F>(view, {4 * a.x - 2, 4 * a.y - 2, 4 * a.z - 2}, b, s));
        }
        if (kind == 0) continue;
        const SurfacePoint point = surface_at<F>(view, 0, 0.2f, 0.3f);
        CHECK(is_zero(emitted_radiance<F>(view, 0, point, point.ng)));
        CHECK(pdf_emitter_direct<F>(view, 0, point.p + point.ng, -point.ng, point) == 0);
    }
}
