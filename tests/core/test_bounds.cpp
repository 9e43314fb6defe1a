// libs: ambilux_core
// timeout: 60
// Frames, ray origins and warps against wide arithmetic: the bounds that stand at their declarations.
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/sampling.h"
#include "tests/support/bounds.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::bounds;

namespace {

/// How far the axes are from orthogonal and unit: the largest of six products.
double defect(const Frame& f) {
    double worst = 0;
    const Vec3f axes[3] = {f.s, f.t, f.n};
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j)
            worst = std::max(worst, std::fabs(double(dot(Exact3(axes[i]), Exact3(axes[j])) - (i == j ? 1 : 0))));
    return worst;
}

double length_defect(Vec3f n) { return std::fabs(double(dot(Exact3(n), Exact3(n)) - 1)); }

}  // namespace

TEST_CASE("The next float is the next one, from any of them that is a number") {
    Numbers numbers(1);
    std::vector<float> values = {0.0f, -0.0f, 1e-45f, -1e-45f, 0x1p-126f, -0x1p-126f, 1, -1, 0x1.fffffep127f};
    values.insert(values.end(), {-0x1.fffffep127f, kInfinity, -kInfinity});
    for (int i = 0; i < 100000; ++i) {
        const float v = bits_float(uint32_t(numbers.rng()));
        if (v == v) values.push_back(v);
    }
    for (const float v : values) {
        REQUIRE(next_float_up(v) == std::nextafter(v, kInfinity));
        REQUIRE(next_float_down(v) == std::nextafter(v, -kInfinity));
    }
}

TEST_CASE("Frames around a normal are orthogonal and unit to 12 roundings, at the poles and anywhere") {
    Numbers numbers(2);
    std::vector<Vec3f> normals = corner_directions();
    for (int i = 0; i < 200000; ++i) normals.push_back(numbers.unit());
    Worst worst;
    for (const Vec3f n : normals) {
        const Frame f = frame_from_normal(n);
        worst.add(defect(f), 12 * kUnit + 2 * length_defect(n));
        REQUIRE(double(dot(cross(Exact3(f.s), Exact3(f.t)), Exact3(n))) > 0.99);  // right-handed
    }
    std::printf("frame_from_normal: %.2f of the bound\n", worst.share);
    CHECK(worst.share <= 1);
}

TEST_CASE("Frames with a tangent are orthogonal and unit: any length of tangent, however close to the normal") {
    Numbers numbers(3);
    Worst worst, aligned;
    for (int i = 0; i < 200000; ++i) {
        const Vec3f n = numbers.unit();
        Vec3f tangent = numbers.unit();
        // Nearly parallel: what is left after the projection may be nothing but rounding.
        if (i % 3 == 0) tangent = n + tangent * numbers.magnitude(-9, -1);
        const double sine = norm(cross(Exact3(tangent), Exact3(n))) / norm(tangent);
        tangent *= numbers.magnitude(-44, 36);
        const Frame f = frame_from_normal_tangent(n, tangent);
        REQUIRE(is_finite(f.s));
        REQUIRE(is_finite(f.t));
        // The projection leaves 5 roundings of the tangent's length along n, of what is as long as its sine; where that
        // is below 2^-10 another frame is taken.
        worst.add(defect(f), (16 + 6 / std::max(sine, 0x1p-10)) * kUnit + 2 * length_defect(n));
        // The s axis lies in the plane of normal and tangent, wherever lengths are ordinary.
        const double l = norm(tangent);
        if (sine > 0x1p-9 && l > 1e-12 && l < 1e18)
            aligned.add(std::fabs(double(dot(cross(Exact3(n), Exact3(tangent)), Exact3(f.s)))) / l, 8 * kUnit / sine);
    }
    std::printf("frame_from_normal_tangent: %.2f and %.2f of the bounds\n", worst.share, aligned.share);
    CHECK(worst.share <= 1);
    CHECK(aligned.share <= 1);
}

TEST_CASE("Ray origins lie beyond every point that the hit may be, and no further than the offset says") {
    Numbers numbers(4);
    Worst inside, far;
    std::vector<Vec3f> normals = corner_directions();
    for (int i = 0; i < 100000; ++i) {
        const Vec3f ng = i % 5 ? numbers.unit() : normals[numbers.index(uint32_t(normals.size()))];
        const Vec3f w = numbers.unit();
        Vec3f p = numbers.vector(-30, 30);
        for (int k = 0; k < 3; ++k)
            if (numbers.chance(0.1f)) p[k] = 0;
        // Errors as surfaces have them, none, and far too large ones.
        Vec3f e = abs(p) * gamma_bound(7);
        if (i % 4 == 1) e = {0, 0, 0};
        if (i % 4 == 2) e = abs(numbers.vector(-30, 20));
        const float offset = ray_offset(p, e, ng);
        const Exact3 o = offset_ray_origin(p, e, ng, w);
        const bool back = dot(w, ng) < 0.0f;
        // The corner of the box around p that lies furthest on the side of w.
        Exact reach = dot(o - Exact3(p), Exact3(ng)) * (back ? -1 : 1) - dot(abs(Exact3(ng)), Exact3(e));
        inside.add(std::max(0.0, double(-reach)), 8 * kUnit * offset + 0x1p-148);
        far.add(std::max(0.0, norm(o - Exact3(p)) - offset * (1 + 4 * kUnit)),
                kUnit * (norm(Exact3(p)) + 4 * offset) + 0x1p-148);
    }
    std::printf("offset_ray_origin: %.2f and %.2f of the bounds\n", inside.share, far.share);
    CHECK(inside.share <= 1);
    CHECK(far.share <= 1);
}

namespace {

/// Calls f(u) for pairs of corner numbers and for random ones.
template <class Function>
void for_squares(uint32_t seed, Function f) {
    const std::vector<float> corners = corner_numbers();
    for (const float x : corners)
        for (const float y : corners) f(Vec2f{x, y});
    Numbers numbers(seed);
    for (int i = 0; i < 200000; ++i) f(Vec2f{numbers.uniform(), numbers.uniform()});
}

constexpr double kTurn = 2 * M_PI;

double distance(Vec3f a, double x, double y, double z) { return std::hypot(a.x - x, a.y - y, a.z - z); }

}  // namespace

TEST_CASE("Directions of the sphere, of cones and of the cosine hemisphere are the maps' to 4e-7, and unit") {
    Worst sphere, cone, hemisphere, unit;
    for_squares(5, [&](Vec2f u) {
        const double angle = kTurn * u.y;
        const Vec3f d = square_to_sphere(u);
        const double r = 2 * std::sqrt(double(u.x) * (1 - double(u.x)));
        sphere.add(distance(d, r * std::cos(angle), r * std::sin(angle), 1 - 2 * double(u.x)), 4e-7);
        unit.add(length_defect(d), 8e-7);
        for (const float end : {2.0f, 0.5f, 1e-3f, 1e-8f, 1e-20f, 1e-30f}) {
            const Vec3f c = square_to_cone(u, end);
            const double v = double(u.x) * double(end), s = std::sqrt(v * (2 - v));
            // Across the axis the error is as small as the cone.
            cone.add(std::hypot(c.x - s * std::cos(angle), c.y - s * std::sin(angle)), 4e-7 * std::max(s, 1e-30));
            cone.add(std::fabs(c.z - (1 - v)), 2 * kUnit);
            unit.add(length_defect(c), 8e-7);
        }
        const Vec3f h = square_to_cosine_hemisphere(u);
        const double a = 2.0 * u.x - 1, b = 2.0 * u.y - 1, radius = std::max(std::fabs(a), std::fabs(b));
        // The square of the cosine: next to the horizon its root has no digits left.
        hemisphere.add(std::fabs(double(h.z) * h.z - (1 - radius * radius)), 8e-7);
        REQUIRE(h.z >= 0.99e-7f);
        unit.add(length_defect(h), 8e-7);
    });
    std::printf("sphere %.2f, cone %.2f, hemisphere %.2f, lengths %.2f of the bounds\n", sphere.share, cone.share,
                hemisphere.share, unit.share);
    for (const Worst& w : {sphere, cone, hemisphere, unit}) CHECK(w.share <= 1);
}

TEST_CASE("Barycentrics are those of the square-root map to 3 roundings, and leave the triangle by 2^-24 at most") {
    Worst worst;
    for_squares(6, [&](Vec2f u) {
        const Vec2f b = square_to_triangle(u);
        const double s = std::sqrt(double(u.x)), b1 = s * (1 - double(u.y)), b2 = s * double(u.y);
        worst.add(std::fabs(b.x - b1), 3.01 * kUnit * b1);
        worst.add(std::fabs(b.y - b2), 3.01 * kUnit * b2);
        REQUIRE(1.0f - b.x - b.y >= -0x1p-24f);
        REQUIRE((b.x >= 0.0f && b.y >= 0.0f));
    });
    CHECK(worst.share <= 1);
}

TEST_CASE("The interval of a cumulative table is the one that holds the number, beside steps and steps of zero width") {
    Numbers numbers(7);
    for (int table = 0; table < 300; ++table) {
        const uint32_t n = 1 + numbers.index(40);
        std::vector<float> cdf(n + 1, 0.0f);
        for (uint32_t i = 1; i < n; ++i) {
            const uint32_t kind = numbers.index(4);
            cdf[i] = kind == 0   ? cdf[i - 1]
                     : kind == 1 ? next_float_up(cdf[i - 1])
                     : kind == 2 ? cdf[i - 1] + (1 - cdf[i - 1]) * numbers.uniform()
                                 : cdf[i - 1] + numbers.magnitude(-30, -3);
            cdf[i] = std::min(cdf[i], 1.0f);
        }
        cdf[n] = 1;
        std::vector<float> asked = corner_numbers();
        for (const float c : cdf) asked.insert(asked.end(), {c, next_float_up(c), next_float_down(c)});
        for (const float u : asked) {
            if (!(u >= 0 && u < 1)) continue;
            const uint32_t i = sample_cdf(cdf.data(), n, u);
            REQUIRE(i < n);
            REQUIRE(cdf[i] <= u);
            REQUIRE(u < cdf[i + 1]);
        }
    }
}
