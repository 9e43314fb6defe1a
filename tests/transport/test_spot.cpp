// libs: ambilux_scene
// timeout: 120
// Spots down to a hundredth of a degree: energy by light sampling and by emission against the closed form, and
// densities wherever there is light.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/emitter/emission.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features kAll = kAllFeatures;
constexpr double kCutoffs[] = {20, 1, 0.1, 0.02, 0.01};
constexpr double kDegree = M_PI / 180;

/// Integrals of f and of f times the squared angle over the cone, f = 1 up to 3/4 of the cutoff and linear to 0 from
/// there (Mitsuba's spot), in double.
struct ClosedForm {
    double flux = 0, squared_angle = 0;
};
ClosedForm closed_form(double cutoff) {
    ClosedForm c;
    const int n = 400000;
    for (int i = 0; i < n; ++i) {
        const double angle = (i + 0.5) / n * cutoff, f = std::min(1.0, (cutoff - angle) / (0.25 * cutoff));
        const double ring = 2 * M_PI * f * std::sin(angle) * cutoff / n;
        c.flux += ring;
        c.squared_angle += ring * angle * angle;
    }
    return c;
}

/// Angle between float vectors, in double, exact for narrow ones too.
double angle_between(Vec3f a, Vec3f b) {
    const double la = std::sqrt(double(a.x) * a.x + double(a.y) * a.y + double(a.z) * a.z),
                 lb = std::sqrt(double(b.x) * b.x + double(b.y) * b.y + double(b.z) * b.z);
    const double x = a.x / la - b.x / lb, y = a.y / la - b.y / lb, z = a.z / la - b.z / lb;
    return 2 * std::asin(std::min(1.0, 0.5 * std::sqrt(x * x + y * y + z * z)));
}

Scene spot_scene(Vec3f axis, double cutoff) {
    Scene scene;
    add_spot(scene, {0, 0, 0}, axis, float(cutoff), float(0.75 * cutoff), {1, 1, 1});
    complete(scene);
    return scene;
}

void check_mean(const Statistics& stats, double expected) {
    INFO(stats.mean() << " +- " << stats.standard_error() << ", expected " << expected);
    // Float directions: a thousandth of the angle at worst, with either sign alike.
    CHECK(std::abs(stats.mean() - expected) < 4.5 * stats.standard_error());
    CHECK(4.5 * stats.standard_error() < 0.01 * expected);
}

}  // namespace

TEST_CASE("Spots of 20 to 0.01 degrees: power on a plane and its spread by emission and by light sampling") {
    for (const Vec3f axis : {Vec3f{0, 0, -1}, Vec3f{0.3f, -0.5f, 0.8f}, Vec3f{1, 0, 0}})
        for (const double cutoff : kCutoffs) {
            const Scene scene = spot_scene(axis, cutoff);
            const SceneView view = view_of(scene);
            const Vec3f d = scene.emitters[0].direction;
            const ClosedForm expected = closed_form(cutoff * kDegree);
            Statistics emitted, emitted_spread, sampled, sampled_spread;
            // A square across the axis at distance 8, a little larger than the light on it.
            const double half = 8.4 * std::tan(cutoff * kDegree);
            const Frame frame = frame_from_normal(d);
            for (uint32_t i = 0; i < 1000000; ++i) {
                const Vec4f a = random(21, i), b = random(21, i, 1);
                EmissionSample e;
                const double flux = sample_emission<kAll>(view, a, {b.x, b.y}, e)
                                        ? double(e.radiance.x) / (double(e.pdf_pos) * e.pdf_dir * e.pick)
                                        : 0;
                const double angle = flux > 0 ? angle_between(e.d, d) : 0;
                emitted.add(flux);
                emitted_spread.add(flux * angle * angle);
                const double x = (2 * double(a.y) - 1) * half, y = (2 * double(b.z) - 1) * half;
                const Vec3f p = d * 8.0f + frame.s * float(x) + frame.t * float(y);
                EmitterSample s;
                double power = 0, seen = 0;
                if (sample_emitter_direct<kAll>(view, p, {0, 0, 0, 0}, s)) {
                    seen = std::atan(std::sqrt(x * x + y * y) / 8);
                    power = double(s.radiance.x) / s.pdf_sa * std::cos(seen) * 4 * half * half;
                }
                sampled.add(power);
                sampled_spread.add(power * seen * seen);
            }
            INFO("cutoff " << cutoff << " degrees, axis " << axis.x << " " << axis.y << " " << axis.z);
            check_mean(emitted, expected.flux);
            check_mean(emitted_spread, expected.squared_angle);
            check_mean(sampled, expected.flux);
            check_mean(sampled_spread, expected.squared_angle);
        }
}

TEST_CASE("Spots: where there is light there is a density, the one that emission samples by") {
    for (const Vec3f axis : {Vec3f{0, 0, -1}, Vec3f{0.3f, -0.5f, 0.8f}})
        for (const double cutoff : {20.0, 1.0, 0.1, 0.02, 0.01, 1e-3, 1e-4}) {
            const Scene scene = spot_scene(axis, cutoff);
            const SceneView view = view_of(scene);
            const Emitter& e = scene.emitters[0];
            const double solid_angle = 4 * M_PI * std::pow(std::sin(cutoff * kDegree / 2), 2);
            const Frame frame = frame_from_normal(e.direction);
            int dark = 0, different = 0;
            for (uint32_t i = 0; i < 200000; ++i) {
                const Vec4f u = random(22, i);
                EmissionSample s;
                if (sample_emission<kAll>(view, u, {u.y, u.z}, s))
                    different += pdf_emission_direction<kAll>(view, 0, s.ng, s.d) != s.pdf_dir;
                // Directions on both sides of the rim, within a few steps of a float.
                const float angle = float(cutoff * kDegree) * (1.0f + (u.x - 0.5f) * 1e-6f);
                const Vec3f d = frame.to_world({sinf(angle) * cosf(7 * u.y), sinf(angle) * sinf(7 * u.y), cosf(angle)});
                if (spot_intensity<kAll>(view, e, d).x > 0)
                    dark += pdf_emission_direction<kAll>(view, 0, d, d) != kInv2Pi / e.one_minus_cos_cutoff;
            }
            INFO("cutoff " << cutoff);
            CHECK(dark == 0);
            CHECK(different == 0);
            CHECK(double(kInv2Pi / e.one_minus_cos_cutoff) * solid_angle == Approx(1).epsilon(1e-6));
        }
}

TEST_CASE("Spots: the intensity falls linearly in the angle, to a few steps of a float direction") {
    for (const double cutoff : {20.0, 1.0, 0.1, 0.01, 1e-3}) {
        const Scene scene = spot_scene({0.3f, -0.5f, 0.8f}, cutoff);
        const SceneView view = view_of(scene);
        const Emitter& e = scene.emitters[0];
        const Frame frame = frame_from_normal(e.direction);
        double worst = 0;
        for (uint32_t i = 0; i < 20000; ++i) {
            const Vec4f u = random(23, i);
            const float r = float(cutoff * kDegree) * (0.7f + 0.35f * u.x);
            const Vec3f d = normalize(e.direction + (frame.s * cosf(7 * u.y) + frame.t * sinf(7 * u.y)) * r);
            const double angle = angle_between(d, e.direction), c = cutoff * kDegree;
            const double expected = std::clamp((c - angle) / (0.25 * c), 0.0, 1.0);
            worst = std::max(worst, std::abs(double(spot_intensity<kAll>(view, e, d).x) - expected));
        }
        INFO("cutoff " << cutoff << ": " << worst);
        // Lengths of the two unit vectors may differ by 2^-22, which adds its square to that of the chord; the slope is
        // four over the cutoff. The rest is rounding of angles.
        CHECK(worst < 8e-6 + 2 * std::pow(0x1p-22 / (cutoff * kDegree), 2));
    }
}
