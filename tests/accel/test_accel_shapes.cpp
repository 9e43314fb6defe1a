// libs: ambilux_formats ambilux_accel
// labels: accel
// Analytic shapes against closed forms in double precision, and surfaces that let rays pass (B34).
#include <cmath>
#include <vector>

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"
#include "accel/pair_bvh.h"
#include "tests/support/accel_scenes.h"
#include "tests/support/catch.h"
#include "tests/support/disk_rays.h"

using namespace ambilux;
using namespace ambilux::accel_test;

namespace {

constexpr Features kShapes = {0, 0, kAllFeatures.primitives, false, false, false};
constexpr Features kOpacity = {0, 0, kAllFeatures.primitives, true, false, true};

/// Crossings by the textbook formula in double precision, in the local space given by the matrix to_local applied in
/// double.
std::vector<double> exact_crossings(const Quadric& q, Vec3f o, Vec3f d) {
    double lo[3], ld[3];
    for (int r = 0; r < 3; ++r) {
        lo[r] = ld[r] = 0;
        for (int c = 0; c < 3; ++c) {
            lo[r] += double(q.to_local.m[r][c]) * (double(o[c]) - double(q.to_world.m[c][3]));
            ld[r] += double(q.to_local.m[r][c]) * double(d[c]);
        }
    }
    std::vector<double> out;
    if (q.type == PrimitiveType::disk) {
        const double t = -lo[2] / ld[2], x = lo[0] + t * ld[0], y = lo[1] + t * ld[1];
        if (t > 0 && x * x + y * y <= 1) out.push_back(t);
        return out;
    }
    const int n = q.type == PrimitiveType::sphere ? 3 : 2;
    double a = 0, b = 0, c = -1;
    for (int i = 0; i < n; ++i) a += ld[i] * ld[i], b += lo[i] * ld[i], c += lo[i] * lo[i];
    const double disc = b * b - a * c;
    if (disc < 0) return out;
    for (const double s : {-1.0, 1.0}) {
        const double t = (-b + s * std::sqrt(disc)) / a, z = lo[2] + t * ld[2];
        if (t > 0 && (n == 3 || (z >= 0 && z <= 1))) out.push_back(t);
    }
    return out;
}

}  // namespace

TEST_CASE("Spheres, disks and cylinders are met where their closed forms say, near and far (B33)") {
    for (const float scale : {1e-4f, 1.0f, 1e4f})
        for (const float distance : {2.0f, 1000.0f}) {
            Scene scene;
            add_random_quadrics(scene, 300, scale, 31);
            Random random(32);
            int hits = 0, different = 0;
            double worst = 0;
            for (int i = 0; i < 60000; ++i) {
                const Quadric& q = scene.quadrics[random.index(300)];
                const Vec3f center = {q.to_world.m[0][3], q.to_world.m[1][3], q.to_world.m[2][3]};
                const Vec3f target = center + random.in_box(1.2f * q.radius);
                const Vec3f d = random.direction();
                const Vec3f o = target - d * (i % 3 ? distance * scale : 0.5f * q.radius);
                const std::vector<double> exact = exact_crossings(q, o, d);
                const QuadricCrossings got = quadric_crossings<kShapes>(q, o, d, kInfinity);
                if (size_t(got.count) != exact.size()) {
                    ++different;
                    continue;
                }
                for (int k = 0; k < got.count; ++k) {
                    ++hits;
                    const Vec3f f = o + d * got.t[k] - center;
                    // Depth error over the slope: what matters is how far the point is from the surface.
                    const Vec3f n =
                        normalize(q.type == PrimitiveType::disk ? q.to_local.transposed_vector({0, 0, 1}) : f);
                    worst = std::max(worst, std::fabs(got.t[k] - exact[size_t(k)]) * std::fabs(dot(n, d)) /
                                                (exact[size_t(k)] + q.radius));
                }
            }
            INFO("scale " << scale << " distance " << distance << " worst " << worst << " different " << different);
            CHECK(hits > 20000);
            CHECK(worst < 2e-5);
            CHECK(different < 60000 / 500);  // silhouettes, at most some 1e-3 of the radius seen from 1000 scales away
        }
}

TEMPLATE_TEST_CASE(
    "A disk blocks no shadow ray that ends on it, and every one that goes through it, however nearly edge-on it is "
    "seen",
    "", EmbreeAccel, CwbvhAccel, PairAccel) {
    int behind = 0;
    for (uint64_t seed = 51; seed < 61; ++seed) {
        const DiskRays disk = rays_that_end_on_a_disk(20000, seed);
        const SceneView view = disk.scene.view();
        const TestType accel(disk.scene);
        for (size_t i = 0; i < disk.rays.size(); ++i) {
            REQUIRE(accel.tracer().template occluded<kShapes>(view, disk.rays[i]) == disk.behind[i]);
            behind += disk.behind[i];
        }
    }
    CHECK(behind > 200000);
}

TEMPLATE_TEST_CASE("Opacity: the share of rays that pass, alike for closest and any hit and for all tracers (B34)", "",
                   EmbreeAccel, CwbvhAccel, PairAccel) {
    // Three layers of triangles, a sphere with two sides and a disk; what is nearest depends on which of the six let
    // the ray pass.
    Scene scene;
    for (int i = 0; i < 3; ++i) add_mesh(scene, {{-9, -9, float(i)}, {9, -9, float(i)}, {0, 9, float(i)}}, {0, 1, 2});
    add_quadric(scene, PrimitiveType::sphere, {0, 0, 5}, frame_from_normal({0, 0, 1}), 1);
    add_quadric(scene, PrimitiveType::disk, {0, 0, 9}, frame_from_normal({0, 0, 1}), 3);
    scene.materials[0].opacity = {0.3f, -1};
    scene.features.opacity = true;
    const SceneView view = scene.view();
    const TestType accel(scene);
    const uint32_t n = 200000;
    const uint32_t count = view.primitive_count(),
                   ids[6] = {0, 1, 2, 3, 3 + count, 4};  // where rays leave the sphere they ask once more
    const float distance[6] = {1, 2, 3, 5, 7, 10};
    double layer[7] = {};
    for (uint32_t i = 0; i < n; ++i) {
        const Ray ray = {{0, 0, -1}, kInfinity, {0, 0, 1}, random_bits({42, i, 0, Stream::test}, 0).x};
        Hit hit;
        const bool met = accel.tracer().template closest<kOpacity>(view, ray, hit);
        REQUIRE(accel.tracer().template occluded<kOpacity>(view, ray) == met);
        // The rule itself, by hand: the first crossing whose hash is below its opacity.
        uint32_t expected = 0;
        while (expected < 6 && !(0.3f > hash_float(ray.alpha_seed, ids[expected]))) ++expected;
        REQUIRE(met == (expected < 6));
        if (met) REQUIRE(hit.prim == ids[expected] % count);
        if (met) REQUIRE(hit.t == Approx(distance[expected]).epsilon(1e-5));
        layer[expected] += 1;
    }
    double pass = 1;
    for (int i = 0; i < 7; ++i) {
        const double p = i < 6 ? pass * 0.3 : pass;
        CHECK(std::fabs(layer[i] / n - p) < 5 * std::sqrt(p * (1 - p) / n));
        pass *= 0.7;
    }
    // Materials of opacity 0 and 1, and kernels without the feature.
    const Ray ray = {{0, 0, -1}, kInfinity, {0, 0, 1}, 3};
    Hit hit;
    scene.materials[0].opacity = {0.0f, -1};
    CHECK_FALSE(accel.tracer().template occluded<kOpacity>(view, ray));
    scene.materials[0].opacity = {1.0f, -1};
    const TestType solid(scene);
    for (const bool met : {solid.tracer().template closest<kOpacity>(view, ray, hit),
                           solid.tracer().template closest<kShapes>(view, ray, hit)}) {
        CHECK(met);
        CHECK(hit.prim == 0);
    }
}

TEMPLATE_TEST_CASE("Opacity from a texture is looked up where the ray meets the surface", "", EmbreeAccel, CwbvhAccel,
                   PairAccel) {
    Scene scene;
    add_mesh(scene, {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}, {0, 1, 2});
    set_uvs(scene, {{0, 0}, {2, 0}, {0, 2}});
    scene.shapes[0].flags = kShapeHasUvs;
    add_quadric(scene, PrimitiveType::cylinder, {5, 0, 0}, frame_from_normal({0, 0, 1}), 1, 1);
    Texture checker = {};
    checker.type = TextureType::checkerboard;
    checker.to_uv[0][0] = checker.to_uv[1][1] = 1;
    checker.color0 = {1, 1, 1};
    checker.color1 = {0, 0, 0};
    scene.textures.push_back(checker);
    scene.materials[0].opacity = {1.0f, 0};
    scene.features.opacity = scene.features.textures = true;
    const SceneView view = scene.view();
    const TestType accel(scene);
    Random random(41);
    for (uint32_t i = 0; i < 5000; ++i) {
        const Vec4f u = random.next();
        const Vec2f p = {0.98f * u.x, 0.98f * u.y};
        const Ray ray = {{p.x, p.y, 1}, kInfinity, {0, 0, -1}, i};
        const bool solid = eval_float<kOpacity>(view, {1.0f, 0}, p) > 0.5f;
        REQUIRE(accel.tracer().template occluded<kOpacity>(view, ray) == solid);
        // Through the cylinder: the first crossing may be open and the second solid.
        const Vec3f d = normalize(Vec3f{1, 0.3f * (u.z - 0.5f), 0.2f * (u.w - 0.5f)});
        const Ray across = {{2, 0, 0.5f}, kInfinity, d, i};
        const QuadricCrossings hits = quadric_crossings<kShapes>(scene.quadrics[0], across.o, across.d, kInfinity);
        float expected = kInfinity;
        for (int k = hits.count - 1; k >= 0; --k)
            if (eval_float<kOpacity>(view, {1.0f, 0}, surface_at<kShapes>(view, 1, hits.u[k], hits.v[k]).uv) > 0.5f)
                expected = hits.t[k];
        Hit hit;
        const bool met = accel.tracer().template closest<kOpacity>(view, across, hit);
        REQUIRE(met == (expected < kInfinity));
        if (met) REQUIRE(hit.t == expected);
    }
}

TEST_CASE("Decisions of a ray at neighbouring primitives are independent") {
    // Chance that two primitives both let a ray pass, within 5 standard errors of the product.
    const uint32_t n = 1000000;
    for (const uint32_t step : {1u, 2u, 3u, 64u})
        for (const float p : {0.1f, 0.5f}) {
            uint32_t both = 0;
            for (uint32_t i = 0; i < n; ++i) {
                const uint32_t seed = random_bits({7, i, step, Stream::test}, 0).x;
                both += hash_float(seed, 100) < p && hash_float(seed, 100 + step) < p;
            }
            const double expected = double(p) * p;
            INFO("step " << step << " p " << p);
            CHECK(std::fabs(both / double(n) - expected) < 5 * std::sqrt(expected * (1 - expected) / n));
        }
}

TEST_CASE("Seeds of rays: neighbouring pixels, samples, depths, subpaths and random seeds decide independently") {
    // Chance that a ray passes, and that it and its neighbour both do, within 5 standard errors.
    const uint32_t n = 1000000;
    const RngKey base = {7, 0, 0, Stream::eye};
    // `number`: of the light subpath among those of its key, or of the light vertex that a shadow ray is for.
    const auto seed = [](const RngKey& key, uint32_t depth, uint32_t number, bool shadow) {
        return shadow ? RandomNumbers{key}.shadow_seed(connection_ray(depth, number))
                      : RandomNumbers{key, number}.opacity_seed(depth);
    };
    const auto neighbour = [](RngKey key, uint32_t& depth, uint32_t& number, bool& shadow, int which) {
        switch (which) {
            case 0: ++key.index; break;
            case 1: ++key.sample; break;
            case 2: ++depth; break;
            case 3: shadow = !shadow; break;
            case 4: key.stream = Stream::light; break;
            case 5: ++key.seed; break;
            case 6: key.seed += 1ull << 32; break;
            case 7: ++number; break;
            default: key.index += 1024;
        }
        return key;
    };
    for (const bool along_samples : {false, true})
        for (int which = 0; which < 9; ++which)
            for (const float p : {0.1f, 0.5f}) {
                uint32_t passed = 0, both = 0;
                for (uint32_t i = 0; i < n; ++i) {
                    RngKey key = base;
                    (along_samples ? key.sample : key.index) = i;
                    uint32_t depth = 1 + i % 7, number = 0;
                    bool shadow = false;
                    const bool one = hash_float(seed(key, depth, number, shadow), 100) < p;
                    const RngKey other = neighbour(key, depth, number, shadow, which);
                    passed += one;
                    both += one && hash_float(seed(other, depth, number, shadow), 100) < p;
                }
                INFO("neighbour " << which << " along samples " << along_samples << " p " << p);
                const auto within = [&](uint32_t count, double expected) {
                    return std::fabs(count / double(n) - expected) < 5 * std::sqrt(expected * (1 - expected) / n);
                };
                CHECK(within(passed, p));
                CHECK(within(both, double(p) * p));
            }
}

TEST_CASE("Primitives of a structure say whether rays may pass through them") {
    Scene scene;
    add_mesh(scene, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2});
    add_mesh(scene, {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {0, 1, 2});
    add_mesh(scene, {{0, 0, 2}, {1, 0, 2}, {0, 1, 2}}, {0, 1, 2});
    add_quadric(scene, PrimitiveType::sphere, {0, 0, 5}, frame_from_normal({0, 0, 1}), 1);
    add_diffuse(scene);
    add_diffuse(scene);
    scene.materials[1].opacity = {0.99f, -1};
    scene.materials[2].opacity = {1.0f, 0};  // from a texture
    scene.shapes[1].material = 1;
    scene.shapes[2].material = 2;
    scene.shapes[3].material = 1;
    scene.features.opacity = true;
    const CwbvhAccel accel(scene);
    REQUIRE(accel.arrays().primitives.size() == 4);
    for (const CwbvhPrimitive& p : accel.arrays().primitives) {
        REQUIRE(p.prim<kOpacity>() < 4);
        CHECK(p.lets_pass() == (p.prim<kOpacity>() > 0));
    }
}
