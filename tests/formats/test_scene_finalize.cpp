// libs: ambilux_formats ambilux_accel ambilux_transport
// timeout: 60
// What finalize_scene derives from a scene, against closed forms.
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/rng.h"
#include "core/sampling.h"
#include "formats/finalize.h"
#include "scene/info.h"
#include "tests/support/catch.h"
#include "transport/emitter/emission.h"

using namespace ambilux;

namespace {

Affine affine(Vec3f x, Vec3f y, Vec3f z, Vec3f o) {
    Affine a;
    for (int i = 0; i < 3; ++i) a.m[i][0] = x[i], a.m[i][1] = y[i], a.m[i][2] = z[i], a.m[i][3] = o[i];
    return a;
}

Affine identity() { return affine({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}); }

/// Scene without surfaces: a camera at `eye` and one diffuse material.
Scene base(Vec3f eye = {0, 0, 0}) {
    Scene s;
    s.sensor.to_world = affine({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, eye);
    s.sensor.filter = FilterType::box;
    s.sensor.filter_radius = 0.5f;
    s.bsdfs.push_back({});
    s.materials.push_back({0, 0, 0, {1, -1}});
    return s;
}

uint32_t add_triangles(Scene& s, const std::vector<std::array<Vec3f, 3>>& triangles) {
    const uint32_t shape = uint32_t(s.shapes.size());
    s.shapes.push_back({0, kNone, 0, uint32_t(s.triangles.size()), uint32_t(triangles.size()), 0});
    for (const auto& t : triangles) {
        const uint32_t v = uint32_t(s.vertices.size());
        for (Vec3f p : t) s.vertices.push_back({p});
        s.triangles.push_back({v, v + 1, v + 2, shape});
    }
    return shape;
}

uint32_t add_quadric(Scene& s, PrimitiveType type, const Affine& to_world, float radius) {
    const uint32_t shape = uint32_t(s.shapes.size());
    s.shapes.push_back({0, kNone, 0, uint32_t(s.triangles.size() + s.quadrics.size()), 1, 0});
    Quadric q{};
    q.type = type;
    q.shape = shape;
    q.radius = radius;
    q.to_world = q.to_local = to_world;
    s.quadrics.push_back(q);
    return shape;
}

Emitter emitter(EmitterType type, Rgb value) {
    Emitter e{};
    e.type = type;
    e.shape = e.area_cdf = kNone;
    e.radiance = {value, -1};
    e.to_world = e.to_local = identity();
    e.direction = {0, 0, 1};
    return e;
}

void add_area_emitter(Scene& s, uint32_t shape, Rgb radiance) {
    Emitter e = emitter(EmitterType::area, radiance);
    e.shape = shape;
    s.shapes[shape].emitter = uint32_t(s.emitters.size());
    s.emitters.push_back(e);
}

/// Adds a float image as environment map.
void add_envmap(Scene& s, uint32_t w, uint32_t h, const std::vector<float>& grey) {
    Texture t{};
    t.type = TextureType::bitmap;
    t.format = TexelFormat::rgba32f;
    t.width = w;
    t.height = h;
    t.to_uv[0][0] = t.to_uv[1][1] = 1;
    t.offset = s.texels.size();
    s.texels.resize(s.texels.size() + grey.size() * 16);
    for (size_t i = 0; i < grey.size(); ++i) {
        const float c[4] = {grey[i], grey[i], grey[i], 1};
        memcpy(s.texels.edit() + t.offset + i * 16, c, 16);
    }
    Emitter e = emitter(EmitterType::envmap, {1, 1, 1});
    e.radiance.texture = int32_t(s.textures.size());
    s.textures.push_back(t);
    s.environment = uint32_t(s.emitters.size());
    s.emitters.push_back(e);
}

}  // namespace

TEST_CASE("hits are sorted by the material of their primitive, as far as 16 bits tell them apart") {
    Scene s = base();
    s.materials.resize(kMostSortKeys + 2, s.materials[0]);
    const std::vector<std::array<Vec3f, 3>> one = {{Vec3f{0, 0, 0}, Vec3f{1, 0, 0}, Vec3f{0, 1, 0}}};
    const uint32_t materials[] = {3, 0, kMostSortKeys - 1, kMostSortKeys, kMostSortKeys + 1};
    for (const uint32_t material : materials) s.shapes[add_triangles(s, one)].material = material;
    finalize_scene(s, LightPicking::power);
    CHECK(s.sort_keys == std::vector<uint16_t>{3, 0, 0xfffd, 0xfffd, 0xfffd});
}

TEST_CASE("areas of all shapes, and the density over a mesh light's triangles (B13)") {
    Scene s = base();
    const uint32_t mesh = add_triangles(s, {{Vec3f{0, 0, 0}, {2, 0, 0}, {0, 3, 0}},
                                            {Vec3f{0, 0, 1}, {1, 0, 1}, {0, 0, 2}},
                                            {Vec3f{5, 5, 5}, {5, 5, 6}, {5, 6, 5}}});
    const uint32_t sphere =
        add_quadric(s, PrimitiveType::sphere, affine({2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {1, 1, 1}), 2);
    const uint32_t ellipse =
        add_quadric(s, PrimitiveType::disk, affine({3, 0, 0}, {0, 0, 2}, {0, -1, 0}, {0, 0, 0}), 3);
    const uint32_t cylinder =
        add_quadric(s, PrimitiveType::cylinder, affine({0.5f, 0, 0}, {0, 0.5f, 0}, {0, 0, 4}, {0, 0, 0}), 0.5f);
    add_area_emitter(s, mesh, {1, 1, 1});
    add_area_emitter(s, sphere, {1, 1, 1});
    finalize_scene(s, LightPicking::power);
    CHECK(s.shapes[mesh].area == Approx(4.0).epsilon(1e-6));
    CHECK(s.shapes[sphere].area == Approx(16 * M_PI).epsilon(1e-6));
    CHECK(s.shapes[ellipse].area == Approx(6 * M_PI).epsilon(1e-6));
    CHECK(s.shapes[cylinder].area == Approx(4 * M_PI).epsilon(1e-6));
    const float* cdf = s.tables.data() + s.emitters[0].area_cdf;
    CHECK(cdf[0] == 0.0f);
    CHECK(cdf[1] == Approx(0.75));
    CHECK(cdf[2] == Approx(0.875));
    CHECK(cdf[3] == 1.0f);
    for (int i = 4; i < 7; ++i) CHECK(cdf[i] == Approx(0.25));  // density per area
    CHECK(s.emitters[1].area_cdf == kNone);
    // Power: pi·area·radiance.
    CHECK(s.emitters[0].pick_probability == Approx(4 / (4 + 16 * M_PI)).epsilon(1e-6));
}

namespace {

/// Emitters are picked with the probability that they state: of evenly spaced random numbers, each begins and ends a
/// step at most beside the numbers that are its own.
void check_picked(const Scene& s) {
    constexpr uint32_t kSteps = 1u << 20;
    std::vector<double> picked(s.emitters.size());
    for (uint32_t i = 0; i < kSteps; ++i) {
        EmissionSample e;
        const float u = (float(i) + 0.5f) / float(kSteps);
        REQUIRE(sample_emission<kAllFeatures>(s.view(), {u, 0.3f, 0.6f, 0.2f}, {0.4f, 0.45f}, e));
        REQUIRE(e.pick == s.emitters[e.emitter].pick_probability);
        ++picked[e.emitter];
    }
    for (size_t i = 0; i < picked.size(); ++i) {
        INFO("emitter " << i << ": " << picked[i] / kSteps << " for " << s.emitters[i].pick_probability);
        CHECK(std::fabs(picked[i] - double(s.emitters[i].pick_probability) * kSteps) <= 2);
    }
}

}  // namespace

TEST_CASE("power of every emitter type decides the pick probability (B10)") {
    Scene s = base();
    const uint32_t light = add_triangles(s, {{Vec3f{-3, 0, 0}, {3, 0, 0}, {0, 3, 0}}});  // area 9
    add_area_emitter(s, light, {2, 2, 2});
    s.emitters.push_back(emitter(EmitterType::point, {5, 5, 5}));
    Emitter spot = emitter(EmitterType::spot, {7, 7, 7});
    set_spot_angles(spot, std::acos(0.5), std::acos(0.8));
    s.emitters.push_back(spot);
    s.emitters.push_back(emitter(EmitterType::directional, {3, 3, 3}));
    s.environment = uint32_t(s.emitters.size());
    s.emitters.push_back(emitter(EmitterType::constant, {0.5f, 0.5f, 0.5f}));
    s.emitters.push_back(emitter(EmitterType::point, {0, 0, 0}));
    finalize_scene(s, LightPicking::power);
    // No more light from infinity than falls on the surfaces, which are smaller than the disk of the bounds.
    const double disk = M_PI * double(s.bounds_radius) * s.bounds_radius;
    REQUIRE(disk > 9);
    const double power[6] = {M_PI * 9 * 2, 4 * M_PI * 5, 2 * M_PI * (1 - 0.65) * 7, 9 * 3, M_PI * 2 * 9 * 0.5, 0};
    double total = 0;
    for (double p : power) total += p;
    REQUIRE(s.emitter_cdf.size() == 7);
    CHECK(s.emitter_cdf[0] == 0.0f);
    CHECK(s.emitter_cdf[6] == 1.0f);
    for (int i = 0; i < 6; ++i) {
        CHECK(s.emitters[i].pick_probability == Approx(power[i] / total).epsilon(1e-5).margin(1e-9));
    }
    CHECK(s.emitters[5].pick_probability == 0.0f);
    check_picked(s);

    finalize_scene(s, LightPicking::uniform);
    check_picked(s);
    for (int i = 0; i < 5; ++i) CHECK(s.emitters[i].pick_probability == Approx(0.2).epsilon(1e-6));
    CHECK(s.emitters[5].pick_probability == 0.0f);  // emits nothing
}

TEST_CASE("a faint emitter keeps a share, black ones alone share equally") {
    Scene s = base();
    s.emitters.push_back(emitter(EmitterType::point, {1e9f, 1e9f, 1e9f}));
    s.emitters.push_back(emitter(EmitterType::point, {1e-9f, 0, 0}));
    finalize_scene(s, LightPicking::power);
    CHECK(s.emitters[1].pick_probability > 0.0f);
    s.emitters[0].radiance.value = s.emitters[1].radiance.value = {0, 0, 0};
    finalize_scene(s, LightPicking::power);
    CHECK(s.emitters[0].pick_probability == 0.5f);
    s.emitters[0].radiance.value = {kInfinity, 0, 0};
    CHECK_THROWS_AS(finalize_scene(s, LightPicking::power), Error);
}

/// How often each of n entries of a cumulative table is picked, over all values of a random float.
std::vector<uint32_t> count_all_picks(const float* cdf, uint32_t n) {
    std::vector<uint32_t> picked(n, 0);
    for (uint32_t k = 0; k < 1u << 24; ++k) ++picked[sample_cdf(cdf, n, uniform_float(k << 8))];
    return picked;
}

/// Emitters whose pick probability is not the share of random floats that pick them, or is zero though they shine.
int wrongly_picked(const Scene& s) {
    const std::vector<uint32_t> picked = count_all_picks(s.emitter_cdf.data(), uint32_t(s.emitters.size()));
    int wrong = 0;
    for (size_t i = 0; i < picked.size(); ++i) {
        const bool shines = s.emitters[i].radiance.value.x > 0;
        wrong += double(s.emitters[i].pick_probability) != picked[i] * 0x1p-24 || (picked[i] > 0) != shines;
    }
    return wrong;
}

TEST_CASE("finite and infinite emitters get an eighth of the picks at least: a stone far away does not take a room's") {
    Scene s = base();
    const uint32_t room = add_triangles(s, {{Vec3f{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}}});
    add_area_emitter(s, room, {1, 1, 1});
    add_triangles(s, {{Vec3f{1e4f, 0, 0}, {1e4f + 1, 0, 0}, {1e4f, 1, 0}}});
    s.environment = uint32_t(s.emitters.size());
    s.emitters.push_back(emitter(EmitterType::constant, {1, 1, 1}));
    finalize_scene(s, LightPicking::power);
    // By areas: the lamp sends pi, the environment at most 2 pi (1 + 0.5).
    CHECK(s.emitters[0].pick_probability == Approx(1.0 / 4).epsilon(1e-5));
    s.emitters[1].radiance.value = splat(1e6f);
    finalize_scene(s, LightPicking::power);
    CHECK(s.emitters[0].pick_probability == Approx(kLeastGroupShare).epsilon(1e-5));
}

TEST_CASE("emitters are picked with exactly their pick probability: weak before strong, 1e5 and 1e6 lamps") {
    for (const LightPicking picking : {LightPicking::power, LightPicking::uniform}) {
        Scene weak_first = base();
        for (float intensity : {1.3e-4f, 1e-9f, 1.0f, 0.3f})
            weak_first.emitters.push_back(emitter(EmitterType::point, splat(intensity)));
        finalize_scene(weak_first, picking);
        CHECK(wrongly_picked(weak_first) == 0);
        for (uint32_t n : {100000u, 1000000u}) {
            Scene s = base();
            for (uint32_t i = 0; i < n; ++i) {
                const Vec4f u = random_floats({7, i, 0, Stream::test}, 0);
                // Black ones, and six orders of magnitude.
                s.emitters.push_back(emitter(EmitterType::point, splat(u.x < 0.05f ? 0.0f : std::pow(10.0f, 6 * u.y))));
            }
            finalize_scene(s, picking);
            INFO(n << " lamps");
            CHECK(wrongly_picked(s) == 0);
        }
    }
}

TEST_CASE("a million faint emitters together take no more than a small share of the picks") {
    Scene s = base();
    s.emitters.push_back(emitter(EmitterType::point, splat(1)));
    for (int i = 0; i < 1000000; ++i) s.emitters.push_back(emitter(EmitterType::point, splat(1e-20f)));
    finalize_scene(s, LightPicking::power);
    CHECK(s.emitters[0].pick_probability > 0.9f);
    CHECK(wrongly_picked(s) == 0);
}

TEST_CASE("triangles of a light of 3e6 are picked with exactly the density that is divided by (B13)") {
    const uint32_t n = 3000000;
    for (const bool equal : {true, false}) {
        Scene s = base();
        const uint32_t mesh = add_triangles(s, {});
        s.vertices = {{Vec3f{0, 0, 0}}, {Vec3f{1, 0, 0}}, {Vec3f{0, 2, 0}}, {Vec3f{1e-3f, 1e-3f, 0}}};
        for (uint32_t i = 0; i < n; ++i) s.triangles.push_back({0, 1, equal || i % 2 ? 2u : 3u, mesh});
        s.shapes[mesh].primitive_count = n;
        add_area_emitter(s, mesh, {1, 1, 1});
        finalize_scene(s, LightPicking::power);
        const float* cdf = s.tables.data() + s.emitters[0].area_cdf;
        const std::vector<uint32_t> picked = count_all_picks(cdf, n);
        double worst = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const double area = equal || i % 2 ? 1.0 : 0.5 * double(1e-3f);
            worst = std::max(worst, std::abs(double(cdf[n + 1 + i]) * area / (picked[i] * 0x1p-24) - 1));
        }
        INFO("equal " << equal);
        CHECK(worst < 2e-7);  // the density is a float
    }
}

TEST_CASE("a light of more triangles than random floats tell apart is refused with advice") {
    Scene s = base();
    s.path = "lamp.xml";
    const uint32_t mesh = add_triangles(s, {});
    s.vertices = {{Vec3f{0, 0, 0}}, {Vec3f{1, 0, 0}}, {Vec3f{0, 2, 0}}};
    s.triangles.assign((1u << 24) + 1, {0, 1, 2, mesh});
    s.shapes[mesh].primitive_count = uint32_t(s.triangles.size());
    add_area_emitter(s, mesh, {1, 1, 1});
    CHECK_THROWS_WITH(finalize_scene(s, LightPicking::power),
                      "lamp.xml: 16777217 triangles in one light; light sampling tells 16777216 apart: split the mesh "
                      "into several shapes");
}

TEST_CASE("bounds hold every surface and the camera; an empty scene has a radius (B9)") {
    Scene empty = base({3, 4, 5});
    empty.environment = 0;
    empty.emitters.push_back(emitter(EmitterType::constant, {1, 1, 1}));
    empty.emitters.push_back(emitter(EmitterType::directional, {1, 1, 1}));
    finalize_scene(empty, LightPicking::power);
    CHECK(empty.bounds_center == Vec3f{3, 4, 5});
    CHECK(empty.bounds_radius > 0.0f);
    CHECK(empty.emitters[0].pick_probability > 0.0f);
    CHECK(empty.emitters[1].pick_probability > 0.0f);

    Scene s = base({0, 0, -20});
    add_triangles(s, {{Vec3f{1, 2, 3}, {4, -5, 6}, {-7, 8, 9}}});
    add_quadric(s, PrimitiveType::sphere, affine({2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {10, 0, 0}), 2);
    add_quadric(s, PrimitiveType::disk, affine({0, 0, 5}, {0, 3, 0}, {1, 0, 0}, {-12, 0, 0}), 5);
    add_quadric(s, PrimitiveType::cylinder, affine({1, 0, 0}, {0, 0, 1}, {0, 9, 0}, {0, 10, 0}), 1);
    finalize_scene(s, LightPicking::power);
    const auto inside = [&](Vec3f p) { return length(p - s.bounds_center) <= s.bounds_radius; };
    CHECK(inside({0, 0, -20}));
    for (const MeshVertex& v : s.vertices) CHECK(inside(v.p));
    for (uint32_t i = 0; i < 1000; ++i) {
        const Vec4f u = random_floats({1, i, 0, Stream::test}, 0);
        const Vec3f d = square_to_sphere({u.x, u.y});
        CHECK(inside(s.quadrics[0].to_world.point(d)));
        const Vec2f c = square_to_disk({u.x, u.y});
        CHECK(inside(s.quadrics[1].to_world.point({c.x, c.y, 0})));
        CHECK(inside(s.quadrics[2].to_world.point({cosf(7 * u.x), sinf(7 * u.x), u.y})));
    }
    CHECK(s.bounds_radius < 30.0f);
}

TEST_CASE("The Gaussian's table inverts its cumulative distribution (B19)") {
    const auto table = [](float radius) {
        Scene s = base();
        s.sensor.filter = FilterType::gaussian;
        s.sensor.filter_radius = radius;
        finalize_scene(s, LightPicking::power);
        return std::vector<float>(s.tables.begin() + s.sensor.filter_table,
                                  s.tables.begin() + s.sensor.filter_table + kFilterTableSize + 1);
    };
    const uint32_t n = kFilterTableSize;
    for (const float radius : {2.0f, 0.7f}) {
        const std::vector<float> t = table(radius);
        CHECK(t[0] == -radius);
        CHECK(t[n] == radius);
        CHECK(t[n / 2] == 0.0f);
        for (uint32_t i = 0; i < n; ++i) REQUIRE(t[i] < t[i + 1]);
        for (uint32_t i = 0; i <= n; ++i) REQUIRE(t[i] == Approx(-t[n - i]).margin(1e-6));
        // Midpoint sums of the filter itself against the table, independent of the closed forms.
        const auto filter = [r = double(radius)](double x) {
            const double a = 8 / (r * r);  // 1/(2 stddev²), stddev = r/4
            return std::exp(-a * x * x) - std::exp(-a * r * r);
        };
        const int steps = 200000;
        std::vector<double> cumulative(steps + 1, 0.0);
        for (int i = 0; i < steps; ++i)
            cumulative[i + 1] = cumulative[i] + filter(-radius + (i + 0.5) * 2 * radius / steps);
        for (uint32_t i = 1; i < n; i += 7) {
            const double x = (t[i] + radius) / (2 * radius) * steps;
            const int k = std::min(int(x), steps - 1);
            const double p = (cumulative[k] + (cumulative[k + 1] - cumulative[k]) * (x - k)) / cumulative[steps];
            REQUIRE(p == Approx(double(i) / n).margin(2e-6));
        }
    }
}

TEST_CASE("environment density: normalised, positive wherever light comes from, and near the radiance") {
    const uint32_t sizes[3][2] = {{8, 5}, {16, 9}, {2, 3}};
    for (const auto& size : sizes) {
        const uint32_t w = size[0], h = size[1];
        for (uint32_t bright = 0; bright < w * h; ++bright) {
            // One bright texel on black: the hardest case for positivity.
            std::vector<float> grey(w * h, 0.0f);
            grey[bright] = 1000;
            Scene s = base();
            add_envmap(s, w, h, grey);
            finalize_scene(s, LightPicking::power);
            const SceneView view = s.view();
            const Emitter& e = s.emitters[0];
            // The density integrates to one, and aliases carry their own.
            double sum = 0, lit = 0;
            for (uint32_t y = 0; y < h; ++y)
                for (uint32_t x = 0; x < w; ++x) {
                    const EnvironmentCell cell = environment_cell(view, w, x, y);
                    REQUIRE(cell.alias < w);
                    sum += cell.pdf;
                    REQUIRE(cell.alias_pdf == environment_cell(view, w, cell.alias, y).pdf);
                }
            CHECK(sum == Approx(double(w) * h).epsilon(1e-6));
            const uint32_t count = 500;
            double worst = 0;
            for (uint32_t i = 0; i < count; ++i) {
                const Vec4f u = random_floats({bright, i, 0, Stream::test}, 0);
                const Vec3f d = square_to_sphere({u.x, u.y});
                const float l = luminance(envmap_radiance(view, e, d)),
                            pdf = pdf_environment_direct<kAllFeatures>(view, d);
                lit += l / count;
                if (l > 0) {
                    REQUIRE(pdf > 0.0f);
                    worst = std::max(worst, double(l) / pdf);
                }
            }
            // No direction carries more than a few times the whole light.
            if (lit > 0) CHECK(worst < 40 * 4 * M_PI * 1000 / (w * h));
        }
    }
    // A constant image has a uniform density over the sphere.
    Scene s = base();
    add_envmap(s, 64, 33, std::vector<float>(64 * 33, 2.0f));
    finalize_scene(s, LightPicking::power);
    const SceneView view = s.view();
    for (uint32_t i = 0; i < 1000; ++i) {
        const Vec4f u = random_floats({9, i, 0, Stream::test}, 0);
        const Vec3f d = square_to_sphere({u.x, u.y});
        // Within a cell of 1/33 in v the solid angle varies with sin(theta): exact in the mean, close apart from the
        // poles.
        if (std::fabs(d.y) < 0.9f)
            CHECK(pdf_environment_direct<kAllFeatures>(view, d) == Approx(kInv4Pi).epsilon(0.12));
    }
    // Black maps shine nowhere and still have valid tables.
    Scene black = base();
    add_envmap(black, 4, 3, std::vector<float>(12, 0.0f));
    black.emitters.push_back(emitter(EmitterType::point, {1, 1, 1}));
    finalize_scene(black, LightPicking::power);
    CHECK(black.emitters[0].pick_probability == 0.0f);
    CHECK(pdf_environment_direct<kAllFeatures>(black.view(), {1, 0, 0}) == 0.0f);
    CHECK(envmap_pdf_direction(black.view(), black.emitters[0], {1, 0, 0}) > 0.0f);
}

TEST_CASE("environment power: mean radiance over the sphere, not over the image") {
    // Bright poles: they fill many texels and little solid angle.
    const uint32_t w = 32, h = 65;
    std::vector<float> grey(w * h, 0.0f);
    double expected = 0;
    for (uint32_t y = 0; y < h; ++y)
        for (uint32_t x = 0; x < w; ++x) grey[y * w + x] = std::fabs(double(y) / (h - 1) - 0.5) > 0.4 ? 1.0f : 0.0f;
    // Integral of the interpolated profile over the sphere.
    const int steps = 100000;
    for (int i = 0; i < steps; ++i) {
        const double v = (i + 0.5) / steps, y = v * (h - 1);
        const int y0 = int(y);
        const double l = grey[y0 * w] * (1 - (y - y0)) + grey[std::min<uint32_t>(y0 + 1, h - 1) * w] * (y - y0);
        expected += l * std::sin(M_PI * v) * M_PI / 2 / steps;
    }
    Scene s = base();
    add_envmap(s, w, h, grey);
    s.emitters.push_back(emitter(EmitterType::directional, {1, 1, 1}));
    finalize_scene(s, LightPicking::power);
    const double ratio = s.emitters[0].pick_probability / s.emitters[1].pick_probability;
    // The solid angle is spread evenly within a cell of 1/65 of the height: errors of that order where the radiance
    // jumps.
    CHECK(ratio == Approx(4 * M_PI * expected).epsilon(0.005));
}

TEST_CASE("features: the smallest set that covers the scene") {
    Scene s = base();
    finalize_scene(s, LightPicking::power);
    CHECK(s.features == Features{});
    add_triangles(s, {{Vec3f{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}});
    s.bsdfs.resize(3);
    s.bsdfs[1] = bsdf_record(Textured<Dielectric>{});
    s.bsdfs[2] = bsdf_record(Textured<Plastic>{});
    s.bsdfs[2].bump_map = 0;
    s.materials.push_back({1, 1, 0, {0.5f, -1}});  // no shape uses it
    s.emitters.push_back(emitter(EmitterType::point, {1, 1, 1}));
    finalize_scene(s, LightPicking::power);
    Features expected;
    expected.bsdfs = bit(BsdfType::diffuse);
    expected.primitives = bit(PrimitiveType::triangle);
    expected.emitters = bit(EmitterType::point);
    CHECK(s.features == expected);
    CHECK(feature_names(s.features) == std::vector<std::string>{"diffuse", "point", "triangle"});

    s.materials.push_back({0, 2, 1, {1, -1}});
    s.shapes[0].material = 1;
    add_quadric(s, PrimitiveType::disk, identity(), 1);
    s.shapes[1].material = 2;
    finalize_scene(s, LightPicking::power);
    expected.bsdfs = bit(BsdfType::diffuse) | bit(BsdfType::dielectric) | bit(BsdfType::plastic);
    expected.primitives |= bit(PrimitiveType::disk);
    expected.opacity = expected.bumps = true;
    CHECK(s.features == expected);
    CHECK(kAllFeatures.covers(s.features));

    const SceneView view = s.view();
    CHECK(view.triangle_count == 1);
    CHECK(view.primitive_count() == 2);
    CHECK(view.emitter_count == 1);
    CHECK(s.memory_bytes() >= 3 * sizeof(Vec3f) + sizeof(Triangle) + sizeof(Quadric) + s.tables.size() * 4);
    const nlohmann::json info = scene_info(s);
    CHECK(info["triangles"] == 1);
    CHECK(info["shapes"]["disk"] == 1);
    CHECK(info["emitters"]["point"] == 1);
    CHECK(info["features"].size() == feature_names(s.features).size());
}
