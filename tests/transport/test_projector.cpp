// libs: ambilux_scene
// A projector lights a plane across its axis evenly, by light sampling and by emission.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/emitter/emission.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features F = kAllFeatures;
constexpr float kTanX = 0.7f, kTanY = 0.4f;

Scene projector() {
    Scene s;
    Emitter& e = add_emitter(s, EmitterType::projector, {3, 2, 1});
    e.position = {0, 0, 2};
    // The axis is -z, +y stays up.
    e.to_world = {{{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 2}}};
    e.to_local = {{{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 2}}};
    e.cutoff = kTanX;
    e.beam_width = kTanY;
    complete(s);
    return s;
}

}  // namespace

TEST_CASE("a plane at distance 2 gets a quarter of the intensity, inside of the frustum only") {
    const Scene scene = projector();
    const SceneView view = scene.view();
    for (float x : {-1.3f, -0.5f, 0.0f, 1.39f, 1.41f})
        for (float y : {-0.79f, 0.0f, 0.81f}) {
            EmitterSample s;
            const bool lit = sample_emitter_direct<F>(view, {x, y, 0}, {0.5f, 0.5f, 0.5f, 0.5f}, s);
            const bool inside = std::fabs(x) < 2 * kTanX && std::fabs(y) < 2 * kTanY;
            INFO(x << " " << y);
            REQUIRE(lit == inside);
            if (lit) CHECK(s.radiance.x * s.wi.z / s.pdf_sa == Approx(3.0 / 4).epsilon(1e-5));
        }
}

TEST_CASE("emission carries the power of the plane, at densities that it states") {
    const Scene scene = projector();
    const SceneView view = scene.view();
    double flux = 0;
    const int n = 10000;
    for (int i = 0; i < n; ++i) {
        EmissionSample s;
        const Vec2f u = {(float(i % 100) + 0.5f) / 100, (float(i / 100) + 0.5f) / 100};
        REQUIRE(sample_emission<F>(view, {0.5f, 0.5f, 0.5f, 0.5f}, u, s));
        REQUIRE(s.pdf_dir == Approx(pdf_emission_direction<F>(view, 0, s.ng, s.d)).epsilon(1e-4));
        flux += double(s.radiance.x) / (s.pdf_dir * s.pick) / n;
    }
    CHECK(flux == Approx(3 * 4 * kTanX * kTanY).epsilon(1e-4));
}
