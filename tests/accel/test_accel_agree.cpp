// libs: ambilux_backends ambilux_formats ambilux_accel
// labels: accel
// timeout: 300
// seconds: 40
// The host builds of the CUDA traversals, of the wide BVH by both of its builders and of the binary one, against
// Embree: same rays, same hits (pitfall G12), at every scale (B33).
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "accel/bvh2.h"
#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "accel/pair_bvh.h"
#include "backends/fast_cwbvh.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"
#include "tests/support/long_run.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

constexpr Features kTriangles = {0, 0, 1u, false, false, false};
constexpr Features kShapes = {0, 0, kAllFeatures.primitives, false, false, false};

struct Double3 {
    double x, y, z;
    explicit Double3(Vec3f v) : x(v.x), y(v.y), z(v.z) {}
    Double3(double a, double b, double c) : x(a), y(b), z(c) {}
    Double3 operator-(Double3 o) const { return {x - o.x, y - o.y, z - o.z}; }
    Double3 operator+(Double3 o) const { return {x + o.x, y + o.y, z + o.z}; }
    Double3 operator*(double s) const { return {x * s, y * s, z * s}; }
};
double dot(Double3 a, Double3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Double3 cross(Double3 a, Double3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double norm(Double3 a) { return std::sqrt(dot(a, a)); }

/// Meeting of a ray and a triangle in double precision, when positions may be off by `slack`.
struct Meeting {
    bool possible = false, certain = false;
    double t_low = 0, t_high = 0;
};

Meeting meet(const Ray& ray, Vec3f p0, Vec3f p1, Vec3f p2, double slack) {
    Meeting m;
    const Double3 o(ray.o), d(ray.d), v[3] = {Double3(p0), Double3(p1), Double3(p2)};
    Double3 n = cross(v[1] - v[0], v[2] - v[0]);
    double longest = 0;
    for (int i = 0; i < 3; ++i) longest = std::max(longest, norm(v[(i + 1) % 3] - v[i]));
    const double area = norm(n);
    // How far the plane's normal may be off, and what that makes of the angle between ray and plane.
    const double tilt = area > 0 ? slack * longest / area : 2.0;
    const double cosine = area > 0 ? dot(n, d) / area : 0.0;
    if (std::fabs(cosine) < 4 * tilt + 1e-5) {
        // Seen from the side: anything between the nearest and the farthest point near the ray may be reported.
        m.t_low = 1e300, m.t_high = -1e300;
        for (const Double3& p : v)
            m.t_low = std::min(m.t_low, dot(p - o, d)), m.t_high = std::max(m.t_high, dot(p - o, d));
        m.t_low -= 10 * slack, m.t_high += 10 * slack;
        m.possible = m.t_high > 0;
        return m;
    }
    n = n * (1 / area);
    const double t = dot(v[0] - o, n) / cosine, margin = 2 * slack / std::fabs(cosine);
    const Double3 p = o + d * t;
    double inside = 1e300;  // signed distance from the border
    for (int i = 0; i < 3; ++i) {
        const Double3 edge = v[(i + 1) % 3] - v[i];
        inside = std::min(inside, dot(cross(n, edge), p - v[i]) / norm(edge));
    }
    m.t_low = t - margin, m.t_high = t + margin;
    m.possible = inside > -margin && m.t_high > 0 && m.t_low < ray.tmax;
    m.certain = inside > margin && m.t_low > 0 && m.t_high < ray.tmax;
    return m;
}

/// True if `hit` (or none) is what some ray within rounding of `ray` meets first. Every primitive is looked at, in
/// double precision; analytic shapes are taken from quadric_crossings, which has its own test.
bool valid(const SceneView& view, const Ray& ray, bool is_hit, const Hit& hit, float scale) {
    const double slack = 2e-6 * scale;
    const double t = is_hit ? double(hit.t) : 1e300;
    bool justified = !is_hit;
    for (uint32_t i = 0; i < view.primitive_count(); ++i) {
        if (view.is_triangle(i)) {
            const Triangle tri = view.triangles[i];
            const Meeting m =
                meet(ray, view.vertices[tri.v0].p, view.vertices[tri.v1].p, view.vertices[tri.v2].p, slack);
            if (m.certain && m.t_high < t) return false;
            if (is_hit && hit.prim == i && m.possible && t >= m.t_low && t <= m.t_high) justified = true;
        } else {
            const QuadricCrossings q = quadric_crossings<kShapes>(view.quadric(i), ray.o, ray.d, ray.tmax);
            if (q.count && q.t[0] + slack < t) return false;
            if (is_hit && hit.prim == i && q.count && fabs(q.t[0] - t) <= slack) justified = true;
        }
    }
    return justified;
}

/// How the two tracers' answers compare over a batch of rays.
struct Agreement {
    uint64_t rays = 0, hits = 0;
    uint64_t ties = 0;       ///< other primitive at the same distance within rounding
    uint64_t different = 0;  ///< hit or distance differs, and both answers are right within rounding
    uint64_t wrong_embree = 0, wrong_own = 0;
};

/// trace() is closest() and occluded().
template <Features F, class Tracer>
void check_trace(const SceneView& view, const Tracer& tracer, const Ray& ray, bool occluded, bool is_hit,
                 const Hit& closest) {
    Hit hit;
    const bool any = tracer.template trace<F>(view, ray, true, hit),
               met = tracer.template trace<F>(view, ray, false, hit);
    if (any != occluded || met != is_hit || std::memcmp(&hit, &closest, sizeof(hit)) != 0)
        FAIL("trace disagrees with closest or occluded");
}

/// What Embree says of a ray.
struct Answer {
    Hit hit;
    bool is_hit, occluded;
};

template <Features F>
Answer answer_of(const SceneView& view, const EmbreeTracer& embree, const Ray& ray) {
    Answer e{};
    e.is_hit = embree.closest<F>(view, ray, e.hit);
    e.occluded = embree.occluded<F>(view, ray);
    check_trace<F>(view, embree, ray, e.occluded, e.is_hit, e.hit);
    return e;
}

template <Features F, class Tracer>
void compare(const SceneView& view, const Answer& e, const Tracer& own, const Ray& ray, float scale, Agreement& a) {
    Hit c;
    const bool c_hit = own.template closest<F>(view, ray, c);
    ++a.rays;
    a.hits += c_hit;
    const bool same = e.is_hit == c_hit && (!c_hit || fabsf(e.hit.t - c.t) <= 1e-5f * (e.hit.t + scale));
    if (!same || e.occluded != c_hit) {
        ++a.different;
        if (!valid(view, ray, c_hit, c, scale)) ++a.wrong_own;
        if (!valid(view, ray, e.is_hit, e.hit, scale)) ++a.wrong_embree;
    } else if (e.hit.prim != c.prim) {
        ++a.ties;
    }
    if (own.template occluded<F>(view, ray) != c_hit) FAIL("any hit and closest hit disagree for ray " << a.rays);
    check_trace<F>(view, own, ray, c_hit, c_hit, c);
}

/// Rays of all kinds that make tracers differ.
std::vector<Ray> test_rays(const Scene& scene, uint32_t count, float scale, uint64_t seed) {
    Random random(seed);
    std::vector<Ray> rays;
    const auto on_triangle = [&](float b1, float b2) {
        const Triangle t = scene.triangles[random.index(uint32_t(scene.triangles.size()))];
        return scene.vertices[t.v0].p * (1 - b1 - b2) + scene.vertices[t.v1].p * b1 + scene.vertices[t.v2].p * b2;
    };
    for (uint32_t i = 0; i < count; ++i) {
        Ray ray = {random.in_box(1.5f * scale), kInfinity, random.direction(), i};
        const float u = random.uniform();
        switch (i % 6) {
            case 0: break;
            case 1: {  // axis-parallel
                ray.d = {0, 0, 0};
                ray.d[int(i / 6 % 3)] = i / 18 % 2 ? 1.0f : -1.0f;
                break;
            }
            case 2: {  // in a coordinate plane
                ray.d[int(i / 6 % 3)] = i / 18 % 2 ? 0.0f : -0.0f;
                ray.d = normalize(ray.d);
                break;
            }
            case 3:  // towards an edge or a vertex
                if (!scene.triangles.empty()) ray.d = normalize(on_triangle(i % 4 ? u : 0.0f, 0.0f) - ray.o);
                break;
            case 4:  // grazing: from one surface point to another, end included or not
                if (!scene.triangles.empty()) {
                    const Vec3f a = on_triangle(0.3f, 0.3f), b = on_triangle(u * 0.5f, 0.4f);
                    if (length(b - a) > 0)
                        ray = {a - normalize(b - a) * (0.1f * scale), kInfinity, normalize(b - a), i};
                }
                break;
            default: ray.tmax = scale * 2.0f * u;
        }
        rays.push_back(ray);
    }
    return rays;
}

template <Features F, class Accel>
void compare_with(const Scene& scene, const std::vector<Ray>& rays, const std::vector<Answer>& answers, float scale,
                  double ties) {
    const SceneView view = scene.view();
    const Accel own(scene);
    Agreement a;
    for (size_t i = 0; i < rays.size(); ++i) compare<F>(view, answers[i], own.tracer(), rays[i], scale, a);
    INFO(a.rays << " rays, " << a.hits << " hits, " << a.ties << " ties, " << a.different
                << " different within rounding, wrong: Embree " << a.wrong_embree << ", own " << a.wrong_own);
    CHECK(a.hits > a.rays / 20);
    CHECK(a.wrong_own == 0);
    CHECK(a.wrong_embree <= a.rays / 100);  // its distances to slivers seen along themselves are less exact; more would
                                            // mean that the oracle is wrong
    // A third of the rays aim at edges, vertices or along surfaces, where both answers may be right.
    CHECK(double(a.different) <= 0.03 * double(a.rays));
    CHECK(double(a.ties) <= ties * double(a.rays));
}

template <Features F>
void compare_all(const Scene& scene, uint32_t count, float scale, uint64_t seed, double ties = 0.05) {
    const EmbreeAccel embree(scene);
    const std::vector<Ray> rays = test_rays(scene, count, scale, seed);
    std::vector<Answer> answers;
    for (const Ray& ray : rays) answers.push_back(answer_of<F>(scene.view(), embree.tracer(), ray));
    {
        INFO("wide");
        compare_with<F, CwbvhAccel>(scene, rays, answers, scale, ties);
    }
    {
        INFO("wide, built fast");
        compare_with<F, FastCwbvhAccel>(scene, rays, answers, scale, ties);
    }
    INFO("binary");
    compare_with<F, PairAccel>(scene, rays, answers, scale, ties);
}

}  // namespace

TEST_CASE("Own structures and Embree agree on triangle soups of every scale (G12, B33)") {
    for (const float scale : first_or_all<float>(3, {1.0f, 1e-4f, 1e4f, 1e-2f})) {
        DYNAMIC_SECTION("scale " << scale) {
            compare_all<kTriangles>(triangle_soup(3000, 0.3f, scale, 7), 60000, scale, 11);
            compare_all<kTriangles>(triangle_soup(50, 2.0f, scale, 8), 60000, scale, 12);
        }
    }
}

TEST_CASE("Own structures and Embree agree on closed meshes with rays through edges and vertices (G12)") {
    Scene ball;
    add_ball(ball, {0, 0, 0}, 1.0f, 40, 0.1f, 3);
    compare_all<kTriangles>(ball, 50000, 1.0f, 13);
    Scene box;
    add_box(box, 1.0f, 16);
    compare_all<kTriangles>(box, 50000, 1.0f, 14);
}

TEST_CASE("A fan of 5000 needles, whose boxes all overlap, has a tree that traversal stacks hold") {
    constexpr uint32_t kNeedles = 5000;
    std::vector<Vec3f> positions = {{0, 0, 0}};
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i <= kNeedles; ++i) {
        const double angle = 2 * M_PI * i / kNeedles;
        positions.push_back({float(std::cos(angle)), float(std::sin(angle)), 0});
        if (i > 0) indices.insert(indices.end(), {0, i, i + 1});
    }
    Scene fan;
    add_mesh(fan, positions, indices);
    CHECK(bvh2_depth(build_optimised_bvh2(fan.view())) <= kMostBvh2Depth);
    // Every sixth ray aims at an edge or a vertex, where there is always a neighbour.
    compare_all<kTriangles>(fan, 2000, 1.0f, 15, 1.0 / 6);
}

TEST_CASE("Own structures and Embree agree on analytic shapes alone and among triangles (G12)") {
    for (const float scale : {1e-4f, 1.0f, 1e4f}) {
        Scene quadrics;
        add_random_quadrics(quadrics, 60, scale, 5);
        compare_all<kShapes>(quadrics, 60000, scale, 15);
        Scene mixed = triangle_soup(500, 0.3f, scale, 9);
        add_random_quadrics(mixed, 60, scale, 6);
        compare_all<kShapes>(mixed, 60000, scale, 16);
    }
}

TEMPLATE_TEST_CASE("No ray leaves a closed mesh from inside", "", CwbvhAccel, FastCwbvhAccel, PairAccel) {
    const auto leaks = [](const Scene& scene, float inner, uint32_t count, uint64_t seed) {
        const SceneView view = scene.view();
        const TestType accel(scene);
        Random random(seed);
        uint64_t escaped = 0;
        for (uint32_t i = 0; i < count; ++i) {
            Ray ray = {random.in_box(inner), kInfinity, random.direction(), i};
            const Triangle t = scene.triangles[random.index(uint32_t(scene.triangles.size()))];
            const float u = random.uniform();
            const Vec3f a = scene.vertices[t.v0].p, b = scene.vertices[t.v1].p;
            if (i % 4 == 1) ray.d = normalize(a - ray.o);                    // at a vertex
            if (i % 4 == 2) ray.d = normalize(a * u + b * (1 - u) - ray.o);  // at an edge
            if (i % 4 == 3) {                                                // at a vertex, origin in one plane with it
                ray.o[int(i / 4 % 3)] = a[int(i / 4 % 3)] * 0.5f;
                ray.d = normalize(a - ray.o);
            }
            Hit hit;
            if (!accel.tracer().template closest<kTriangles>(view, ray, hit)) ++escaped;
            if (!accel.tracer().template occluded<kTriangles>(view, ray)) ++escaped;
        }
        return escaped;
    };
    Scene ball;
    add_ball(ball, {0.3f, -0.2f, 0.1f}, 1.0f, 50, 0.0f, 3);
    CHECK(leaks(ball, 0.3f, is_long_run() ? 1000000 : 250000, 21) == 0);
    Scene rough;
    add_ball(rough, {0, 0, 0}, 1.0f, 30, 0.3f, 4);
    CHECK(leaks(rough, 0.4f, 300000, 22) == 0);
    Scene box;
    add_box(box, 1.0f, 13);
    CHECK(leaks(box, 0.9f, 300000, 23) == 0);
    Scene coarse;
    add_box(coarse, 1e4f, 1);
    CHECK(leaks(coarse, 0.9e4f, 300000, 24) == 0);
    Scene far_ball;
    add_ball(far_ball, {1000, 2000, -3000}, 10.0f, 30, 0.1f, 5);
    const SceneView view = far_ball.view();
    const TestType accel(far_ball);
    Random random(25);
    uint64_t escaped = 0;
    for (uint32_t i = 0; i < 200000; ++i) {
        const Ray ray = {Vec3f{1000, 2000, -3000} + random.in_box(3.0f), kInfinity, random.direction(), i};
        Hit hit;
        escaped += !accel.tracer().template closest<kTriangles>(view, ray, hit);
    }
    CHECK(escaped == 0);
}

TEMPLATE_TEST_CASE("Rays that are not numbers hit nothing and end", "", EmbreeAccel, CwbvhAccel, FastCwbvhAccel,
                   PairAccel) {
    Scene scene = triangle_soup(100, 0.5f, 1.0f, 1);
    add_random_quadrics(scene, 9, 1.0f, 2);
    const SceneView view = scene.view();
    const TestType accel(scene);
    const float nan = NAN, inf = kInfinity;
    Hit hit;
    for (const float bad : {nan, inf, -inf})
        for (int axis = 0; axis < 3; ++axis) {
            Ray ray = {{0, 0, 0}, inf, {0, 0, 1}, 0};
            ray.o[axis] = bad;
            CHECK_FALSE(accel.tracer().template closest<kShapes>(view, ray, hit));
            CHECK(hit.prim == kNone);
            CHECK_FALSE(accel.tracer().template occluded<kShapes>(view, ray));
            ray = {{0, 0, 0}, inf, {0, 0, 1}, 0};
            ray.d[axis] = bad;
            CHECK_FALSE(accel.tracer().template closest<kShapes>(view, ray, hit));
            CHECK_FALSE(accel.tracer().template occluded<kShapes>(view, ray));
        }
    for (const float tmax : {nan, 0.0f, -1.0f, -inf}) {
        const Ray ray = {{0, 0, -3}, tmax, {0, 0, 1}, 0};
        CHECK_FALSE(accel.tracer().template closest<kShapes>(view, ray, hit));
        CHECK_FALSE(accel.tracer().template occluded<kShapes>(view, ray));
    }
    CHECK_FALSE(accel.tracer().template closest<kShapes>(view, {{0, 0, 0}, inf, {0, 0, 0}, 0}, hit));
}

TEMPLATE_TEST_CASE("Scenes of none, one and many equal primitives", "", EmbreeAccel, CwbvhAccel, FastCwbvhAccel,
                   PairAccel) {
    const Ray ray = {{0.25f, 0.25f, -1}, kInfinity, {0, 0, 1}, 0};
    Hit hit;
    Scene empty;
    const TestType nothing(empty);
    CHECK_FALSE(nothing.tracer().template closest<kShapes>(empty.view(), ray, hit));
    CHECK_FALSE(nothing.tracer().template occluded<kShapes>(empty.view(), ray));

    Scene one;
    add_mesh(one, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    const TestType single(one);
    REQUIRE(single.tracer().template closest<kShapes>(one.view(), ray, hit));
    CHECK(hit.t == 1.0f);
    CHECK(hit.u == Approx(0.25f));
    CHECK(hit.v == Approx(0.25f));
    CHECK(hit.prim == 0);

    Scene sphere;
    add_quadric(sphere, PrimitiveType::sphere, {0, 0, 2}, frame_from_normal({0, 0, 1}), 1.0f);
    const TestType ball(sphere);
    REQUIRE(ball.tracer().template closest<kShapes>(sphere.view(), {{0, 0, -1}, kInfinity, {0, 0, 1}, 0}, hit));
    CHECK(hit.t == 2.0f);
    CHECK(hit.prim == 0);

    // Equal, flat and empty triangles; the bound of a hit excludes tmax. Embree multiplies by an estimated reciprocal,
    // whose last bit depends on the processor.
    constexpr float kUlp = 0x1p-23f;
    constexpr float kEnd = std::is_same_v<TestType, EmbreeAccel> ? 1.0f - 2 * kUlp : 1.0f,
                    kBeyond = std::is_same_v<TestType, EmbreeAccel> ? 1.0f + 2 * kUlp : 1.0f + kUlp;
    Scene many;
    for (int i = 0; i < 5000; ++i) add_mesh(many, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2, 0, 1, 1, 0, 0, 0});
    const TestType pile(many);
    REQUIRE(pile.tracer().template closest<kShapes>(many.view(), ray, hit));
    CHECK(hit.t == 1.0f);
    CHECK_FALSE(pile.tracer().template occluded<kShapes>(many.view(), {ray.o, kEnd, ray.d, 0}));
    CHECK(pile.tracer().template occluded<kShapes>(many.view(), {ray.o, kBeyond, ray.d, 0}));

    // Vertices that are not numbers belong to no hit and do no harm.
    Scene broken;
    add_mesh(broken, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {NAN, 0, 0}, {kInfinity, 0, 0}}, {0, 1, 2, 0, 1, 3, 0, 4, 2});
    const TestType partial(broken);
    REQUIRE(partial.tracer().template closest<kShapes>(broken.view(), ray, hit));
    CHECK(hit.prim == 0);
}

TEMPLATE_TEST_CASE("The structure is the same however often it is built, and its boxes hold what is in them", "",
                   CwbvhAccel, FastCwbvhAccel) {
    Scene scene = triangle_soup(20000, 0.4f, 1.0f, 77);
    add_random_quadrics(scene, 30, 1.0f, 78);
    const TestType first(scene);
    for (int i = 0; i < 3; ++i) {
        const TestType again(scene);
        REQUIRE(again.arrays().nodes.size() == first.arrays().nodes.size());
        REQUIRE(again.arrays().primitives.size() == first.arrays().primitives.size());
        CHECK(std::memcmp(again.arrays().nodes.data(), first.arrays().nodes.data(),
                          first.arrays().nodes.size() * sizeof(CwbvhNode)) == 0);
        CHECK(std::memcmp(again.arrays().primitives.data(), first.arrays().primitives.data(),
                          first.arrays().primitives.size() * sizeof(CwbvhPrimitive)) == 0);
    }
    std::vector<bool> seen(scene.triangles.size() + scene.quadrics.size());
    for (const CwbvhPrimitive& p : first.arrays().primitives) seen[p.prim<kAllFeatures>()] = true;
    CHECK(std::count(seen.begin(), seen.end(), false) == 0);
    CHECK(first.arrays().depth <= uint32_t(kCwbvhStackSize));
}

TEST_CASE("Reinsertion lowers the cost of a tree, keeps what it holds, and does the same on one thread as on all") {
    const Scene scene = triangle_soup(3000, 0.3f, 1.0f, 7);
    const SceneView view = scene.view();
    const Bvh2 before = build_bvh2(view);
    Bvh2 after = before, again = before;
    tbb::task_arena(1).execute([&] { optimise_bvh2(after, kReinsertionPasses); });
    optimise_bvh2(again, kReinsertionPasses);
    CHECK(bvh2_cost(after) < bvh2_cost(before));  // little is to be gained among triangles in no order
    REQUIRE(after.nodes.size() == again.nodes.size());
    CHECK(std::memcmp(after.nodes.data(), again.nodes.data(), after.nodes.size() * sizeof(Bvh2Node)) == 0);
    // Every leaf once, below boxes that hold it.
    std::vector<uint32_t> stack = {after.root}, seen(after.nodes.size(), 0);
    bool nested = true;
    while (!stack.empty()) {
        const uint32_t at = stack.back();
        stack.pop_back();
        ++seen[at];
        const Bvh2Node& n = after.nodes[at];
        if (n.is_leaf()) continue;
        for (const uint32_t child : {n.left, n.right}) {
            Bounds3f joint = n.bounds;
            joint.extend(after.nodes[child].bounds);
            nested = nested && joint.lower == n.bounds.lower && joint.upper == n.bounds.upper;
            stack.push_back(child);
        }
    }
    CHECK(nested);
    for (const uint32_t times : seen) REQUIRE(times == 1);
}
