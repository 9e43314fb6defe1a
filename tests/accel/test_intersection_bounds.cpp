// libs: ambilux_formats ambilux_accel
// labels: accel
// timeout: 60
// The ray-primitive tests themselves against wide arithmetic: distances, barycentrics, shared edges, residuals.
#include <cmath>
#include <cstdio>

#include "accel/quadric_intersect.h"
#include "accel/triangle_test.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/bounds.h"
#include "tests/support/catch.h"

using namespace ambilux;
using namespace ambilux::accel_test;
using namespace ambilux::bounds;

namespace {

constexpr Features kShapes = {0, 0, kAllFeatures.primitives, false, false, false};

/// Edge functions of three vertices seen along `d` from the origin, without rounding, and bounds of their errors.
struct Edges {
    Exact value[3];     ///< opposite to v0, v1, v2
    Exact rounding[3];  ///< bounds of the errors in intersect_triangle
};

Edges exact_edges(Vec3f o, Vec3f d, const Vec3f (&p)[3]) {
    const Vec3f m = abs(d);
    const int k = m.x > m.y && m.x > m.z ? 0 : m.y > m.z ? 1 : 2, i = (k + 1) % 3, j = (k + 2) % 3;
    Exact x[3], y[3], mx[3], my[3];
    for (int v = 0; v < 3; ++v) {
        const Exact3 a = Exact3(p[v]) - Exact3(o);
        const Exact sx = Exact(d[i]) / Exact(d[k]), sy = Exact(d[j]) / Exact(d[k]);
        x[v] = a[i] - a[k] * sx;
        y[v] = a[j] - a[k] * sy;
        mx[v] = abs(a[i]) + abs(a[k] * sx);
        my[v] = abs(a[j]) + abs(a[k] * sy);
    }
    Edges e;
    for (int v = 0; v < 3; ++v) {
        const int a = (v + 1) % 3, b = (v + 2) % 3;
        e.value[v] = x[b] * y[a] - y[b] * x[a];
        // A coordinate: subtraction 1, shear 2, sum 2 roundings; a product has two of them, their difference 3 more.
        e.rounding[v] = Exact(kUnit) * (10 * (mx[b] * my[a] + my[b] * mx[a]) + 3 * abs(e.value[v]));
    }
    return e;
}

struct Case {
    Vec3f o, d, p[3];
};

/// A triangle of any size and place, and a ray to a point near it: within, beside, at grazing angles, from far away.
Case random_case(Numbers& numbers) {
    Case c;
    const float size = numbers.magnitude(-6, 6);
    const Vec3f base = numbers.chance(0.4f) ? Vec3f{0, 0, 0} : numbers.unit(-12) * (size * numbers.magnitude(-3, 4));
    const Vec3f a = numbers.unit(-12), b = numbers.unit(-12);
    c.p[0] = base;
    c.p[1] = base + a * size;
    c.p[2] = base + (numbers.chance(0.4f) ? a + b * numbers.magnitude(-4, 0) : b) * size;
    Vec2f w = {numbers.uniform() * 1.1f, numbers.uniform() * 1.1f};
    if (w.x + w.y > 1.1f) w = {1 - w.x, 1 - w.y};
    if (numbers.chance(0.3f)) w.x = numbers.chance(0.5f) ? 0.0f : numbers.magnitude(-9, -5);
    const Vec3f target = c.p[0] + (c.p[1] - c.p[0]) * w.x + (c.p[2] - c.p[0]) * w.y;
    c.d = numbers.unit(-12);
    const Vec3f n = detail::triangle_normal(c.p[1] - c.p[0], c.p[2] - c.p[0]);
    if (numbers.chance(0.3f)) c.d = normalize(c.d - n * (dot(c.d, n) * (1 - numbers.magnitude(-6, -1))));
    c.o = target - c.d * (size * numbers.magnitude(-3, 3));
    return c;
}

}  // namespace

TEST_CASE(
    "Rays and triangles: distances and barycentrics within the counted roundings, hits and misses where certain") {
    Numbers numbers(1);
    Worst distance, barycentric;
    int hits = 0, wrong_hits = 0, wrong_misses = 0;
    for (int i = 0; i < 400000; ++i) {
        const Case c = random_case(numbers);
        TriangleCrossing hit = {};
        const bool met = intersect_triangle(c.o, c.d, make_ray_shear(c.d), c.p[0], c.p[1], c.p[2], kInfinity, hit);
        const Edges e = exact_edges(c.o, c.d, c.p);
        const Exact3 e1 = Exact3(c.p[1]) - Exact3(c.p[0]), e2 = Exact3(c.p[2]) - Exact3(c.p[0]),
                     a = Exact3(c.p[0]) - Exact3(c.o);
        const Exact3 n = cross(e1, e2), d = c.d;
        // Sizes of what the normal is a difference of, and through it height and slope.
        const Exact3 size = {abs(e1.y * e2.z) + abs(e1.z * e2.y), abs(e1.z * e2.x) + abs(e1.x * e2.z),
                             abs(e1.x * e2.y) + abs(e1.y * e2.x)};
        const Exact height = dot(a, n), slope = dot(d, n);
        const Exact height_error = 9 * Exact(kUnit) * dot(abs(a), size),
                    slope_error = 9 * Exact(kUnit) * dot(abs(d), size);
        int positive = 0, negative = 0;
        for (int k = 0; k < 3; ++k) positive += e.value[k] > e.rounding[k], negative += e.value[k] < -e.rounding[k];
        const bool inside = positive == 3 || negative == 3, outside = positive > 0 && negative > 0;
        const bool before =
            (height > 0) == (slope > 0) && abs(height) > 2 * height_error && abs(slope) > 2 * slope_error;
        if (met) {
            ++hits;
            wrong_hits += outside;
            distance.add(double(abs(Exact(hit.t) * slope - height)), double(height_error + Exact(hit.t) * slope_error));
            const Exact det = e.value[0] + e.value[1] + e.value[2];
            const Exact sum = abs(e.value[0]) + abs(e.value[1]) + abs(e.value[2]);
            const Exact det_error = e.rounding[0] + e.rounding[1] + e.rounding[2] + 2 * Exact(kUnit) * sum;
            const Exact uv[2] = {hit.u, hit.v};
            for (int k = 0; k < 2; ++k)
                barycentric.add(double(abs(uv[k] * det - e.value[k + 1])),
                                double(e.rounding[k + 1] + abs(uv[k]) * (det_error + 2 * Exact(kUnit) * abs(det))));
        } else {
            wrong_misses += inside && before;
        }
    }
    std::printf("triangles: %d hits, distances %.2f, barycentrics %.2f of the bounds\n", hits, distance.share,
                barycentric.share);
    CHECK(hits > 100000);
    CHECK(wrong_hits == 0);
    CHECK(wrong_misses == 0);
    CHECK(distance.share <= 1);
    CHECK(barycentric.share <= 1);
}

TEST_CASE(
    "A ray through a shared edge or vertex meets one of its triangles, wherever that is and however it is ordered") {
    Numbers numbers(2);
    int tried = 0, missed = 0;
    for (int i = 0; i < 300000; ++i) {
        const float size = numbers.magnitude(-6, 6);
        const Vec3f base =
            numbers.chance(0.3f) ? Vec3f{0, 0, 0} : numbers.unit(-12) * (size * numbers.magnitude(-2, 5));
        const Vec3f d = numbers.unit(-12);
        const Frame f = frame_from_normal(d);
        // A fan around a vertex, seen from its side: the corners in order around the ray, at any depth.
        const uint32_t n = 3 + numbers.index(4);
        Vec3f corner[8];
        for (uint32_t k = 0; k < n; ++k) {
            const float phi = 2 * kPi * (float(k) + 0.8f * numbers.uniform()) / float(n);
            corner[k] = base + (f.s * cosf(phi) + f.t * sinf(phi)) * (size * numbers.magnitude(-1, 0)) +
                        d * (size * (numbers.uniform() - 0.5f));
        }
        // Through the middle vertex, or a point of a spoke as well as floats can name it.
        Vec3f target = base;
        if (i % 2) target = base + (corner[0] - base) * numbers.uniform();
        const Vec3f o = target - d * (size * (2 + numbers.magnitude(-1, 3)));
        // Rounding of base and origin may turn the fan over or carry the ray past its rim: only where it cannot.
        const double blur = 64 * kUnit * (norm(Exact3(base)) + norm(Exact3(o)) + double(size));
        bool certain = true;
        for (uint32_t k = 0; k < n; ++k) {
            const Vec3f &a = corner[k], &b = corner[(k + 1) % n];
            const Exact3 pa = Exact3(a) - Exact3(base), pb = Exact3(b) - Exact3(base);
            const Exact3 dd = d;
            const Exact3 across = cross(dd, pb - pa);
            // The rim's distance from target and vertex as seen along the ray.
            const double l = norm(across);
            certain = certain && l > 0 && double(dot(pa, across)) / l < -blur &&
                      double(dot(Exact3(a) - Exact3(target), across)) / l<-blur&& double(dot(dd, cross(pa, pb)))> blur *
                          (norm(pa) + norm(pb));
        }
        if (!certain) continue;
        ++tried;
        const RayShear shear = make_ray_shear(d);
        bool met = false;
        for (uint32_t k = 0; k < n; ++k) {
            const Vec3f three[3] = {base, corner[k], corner[(k + 1) % n]};
            const uint32_t first = numbers.index(3), step = 1 + numbers.index(2);
            TriangleCrossing hit;
            met = met || intersect_triangle(o, d, shear, three[first], three[(first + step) % 3],
                                            three[(first + 2 * step) % 3], kInfinity, hit);
        }
        missed += !met;
    }
    std::printf("shared edges: %d rays\n", tried);
    CHECK(tried > 50000);
    CHECK(missed == 0);
}

TEST_CASE(
    "Rays and quadrics: hits lie on them, hits and misses where certain, grazing, from far and from the surface") {
    Numbers numbers(3);
    for (const PrimitiveType type : {PrimitiveType::sphere, PrimitiveType::disk, PrimitiveType::cylinder}) {
        Worst residual;
        int hits = 0, wrong_hits = 0, wrong_misses = 0;
        for (int i = 0; i < 200000; ++i) {
            const float radius = numbers.magnitude(-4, 4);
            const float length = radius * numbers.magnitude(-2, 2);
            const Vec3f center = numbers.unit(-12) * (radius * numbers.magnitude(-4, 3));
            Scene scene;
            accel_test::add_quadric(scene, type, center, frame_from_normal(numbers.unit(-12)), radius, length);
            const Quadric& q = scene.quadrics[0];
            // Towards a point of the surface, or just beside its outline.
            const Vec3f d = numbers.unit(-12);
            Vec3f target;
            if (i % 3) {
                Vec2f c = {2 * numbers.uniform() - 1, 2 * numbers.uniform() - 1};
                if (type == PrimitiveType::cylinder) c = {kPi * c.x, fabsf(c.y)};
                target = surface_at<kShapes>(scene.view(), 0, c.x, c.y).p;
            } else {
                const Vec3f side = normalize(cross(d, numbers.unit(-12)));
                target = center + side * (radius * (1 + numbers.magnitude(-8, -2, true)));
            }
            const Vec3f o = i % 7 == 0 ? target : target - d * (radius * numbers.magnitude(-4, 4));
            const QuadricCrossings got = quadric_crossings<kShapes>(q, o, d, kInfinity);
            const Exact3 f = Exact3(o) - Exact3(center), dd = d;
            const Exact3 axis = Exact3(Vec3f{q.to_world.m[0][2], q.to_world.m[1][2], q.to_world.m[2][2]});
            const Exact axis2 = dot(axis, axis);
            const auto across = [&](Exact3 v) {
                return type == PrimitiveType::cylinder ? v - axis * (dot(v, axis) / axis2) : v;
            };
            // Roundings of the way from the centre to the origin, and of the shape itself.
            const double blur =
                16 * kUnit * (norm(f) + double(radius) + (type == PrimitiveType::cylinder ? double(length) : 0));
            for (int k = 0; k < got.count; ++k) {
                ++hits;
                const Exact3 p = f + dd * Exact(got.t[k]);
                if (type == PrimitiveType::disk)
                    residual.add(std::fabs(double(dot(p, axis))) / std::sqrt(double(axis2)), blur);
                else
                    residual.add(std::fabs(norm(across(p)) - double(radius)), blur);
            }
            // Whether the line passes clearly inside or outside.
            if (type == PrimitiveType::disk) continue;
            const Exact3 fa = across(f), da = across(dd);
            const Exact a = dot(da, da);
            if (!(a > Exact(1e-6))) continue;
            const double closest = norm(fa - da * (dot(fa, da) / a));
            wrong_hits += closest > double(radius) + blur && got.count > 0;
            if (type == PrimitiveType::sphere && norm(f) > double(radius) + blur && dot(f, dd) < 0)
                wrong_misses += closest < double(radius) - blur && got.count != 2;
        }
        std::printf("quadric %d: %d hits, residuals %.2f of the bound\n", int(type), hits, residual.share);
        CHECK(hits > 30000);
        CHECK(wrong_hits == 0);
        CHECK(wrong_misses == 0);
        CHECK(residual.share <= 1);
    }
}
