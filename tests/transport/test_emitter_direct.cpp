// libs: ambilux_scene ambilux_core
// timeout: 120
// Next event estimation against closed forms: the irradiance of each emitter, alone and together.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features kAll = kAllFeatures;

/// Irradiance at p with normal n by light sampling, luminance weights replaced by the red channel.
Statistics irradiance(const SceneView& view, Vec3f p, Vec3f n, uint32_t samples, uint32_t seed) {
    Statistics stats;
    int wrong = 0;
    for (uint32_t i = 0; i < samples; ++i) {
        EmitterSample s;
        double value = 0;
        if (sample_emitter_direct<kAll>(view, p, random(seed, i), s)) {
            wrong += !(s.pdf_sa > 0.0f) || !is_finite(s.radiance) || !(std::fabs(length(s.wi) - 1.0f) < 1e-5f);
            value = double(s.radiance.x) * std::max(0.0f, dot(n, s.wi)) / s.pdf_sa;
        }
        stats.add(value);
    }
    REQUIRE(wrong == 0);
    return stats;
}

/// Within 4.5 standard errors, and those small enough that a bias of 2% fails.
void check_irradiance(const Statistics& stats, double expected) {
    INFO("mean " << stats.mean() << " +- " << stats.standard_error() << ", expected " << expected);
    CHECK(stats.standard_error() * 4.5 < 0.01 * expected);
    CHECK(std::fabs(stats.mean() - expected) < 4.5 * stats.standard_error() + 2e-5 * expected);
}

using Vec3d = std::array<double, 3>;
Vec3d to_double(Vec3f v) { return {v.x, v.y, v.z}; }
Vec3d cross_d(Vec3d a, Vec3d b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot_d(Vec3d a, Vec3d b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Irradiance per radiance of a polygon wholly above the horizon (Lambert 1760; Arvo 1995, equation 2.6): half the sum
/// over edges of the angle times the cosine between the receiver's normal and the normal of the plane through edge and
/// receiver.
double polygon_irradiance(const std::vector<Vec3f>& polygon, Vec3f p, Vec3f n) {
    double sum = 0;
    for (size_t i = 0; i < polygon.size(); ++i) {
        Vec3d a = to_double(polygon[i] - p), b = to_double(polygon[(i + 1) % polygon.size()] - p);
        const Vec3d c = cross_d(a, b);
        const double lc = std::sqrt(dot_d(c, c));
        const double angle = std::atan2(lc, dot_d(a, b));
        sum += angle * dot_d(to_double(n), c) / lc;
    }
    return std::fabs(sum) / 2;
}

/// Bilinear lookup in a latitude-longitude image in double, columns periodic at (i+0.5)/w, rows at j/(h-1).
double env_lookup(const std::vector<Rgb>& image, int w, int h, double u, double v) {
    const double x = (u - std::floor(u)) * w - 0.5, y = std::min(std::max(v, 0.0), 1.0) * (h - 1);
    const int x0 = int(std::floor(x)), y0 = std::min(int(y), h - 2);
    const double wx = x - x0, wy = y - y0;
    const auto at = [&](int i, int j) { return double(image[size_t(j * w + (i + w) % w)].x); };
    return (1 - wy) * ((1 - wx) * at(x0, y0) + wx * at(x0 + 1, y0)) +
           wy * ((1 - wx) * at(x0, y0 + 1) + wx * at(x0 + 1, y0 + 1));
}

double env_irradiance(const std::vector<Rgb>& image, int w, int h, Vec3d normal_local) {
    double sum = 0;
    const int nu = 1600, nv = 800;
    for (int j = 0; j < nv; ++j) {
        const double v = (j + 0.5) / nv, theta = v * M_PI;
        for (int i = 0; i < nu; ++i) {
            const double u = (i + 0.5) / nu, phi = u * 2 * M_PI;
            const Vec3d d = {std::sin(phi) * std::sin(theta), std::cos(theta), -std::cos(phi) * std::sin(theta)};
            sum += env_lookup(image, w, h, u, v) * std::max(0.0, dot_d(d, normal_local)) * std::sin(theta);
        }
    }
    return sum * 2 * M_PI * M_PI / (double(nu) * nv);
}

std::vector<Rgb> test_sky(int w, int h) {
    std::vector<Rgb> image;
    for (int j = 0; j < h; ++j)
        for (int i = 0; i < w; ++i)
            image.push_back(splat(0.2f + 0.1f * float((i * 7 + j * 3) % 5) + (i == 5 && j == 3 ? 200.0f : 0.0f)));
    return image;
}

}  // namespace

TEST_CASE("B13: a rectangle as 2 and as 200 unequal triangles has the analytic form factor", "[emitter]") {
    const Vec3f o = {-1, -0.7f, 2}, ex = {0, 1.5f, 0.2f}, ey = {1.8f, 0.1f, 0};  // ex × ey points down
    const std::vector<Vec3f> corners = {o, o + ex, o + ex + ey, o + ey};
    for (uint32_t n : {1u, 10u}) {
        Scene scene;
        add_area(scene, add_rectangle(scene, o, ex, ey, n), splat(3));
        complete(scene);
        REQUIRE(scene.triangles.size() == 2 * n * n);
        const SceneView view = view_of(scene);
        const std::pair<Vec3f, Vec3f> receivers[] = {{{0, 0, 0}, {0, 0, 1}},
                                                     {{-0.2f, 0.1f, 1.7f}, {0, 0, 1}},
                                                     {{4, -3, 1.5f}, normalize(Vec3f{-1, 0.8f, 0.2f})},
                                                     {{300, 200, -500}, normalize(Vec3f{-3, -2, 5})}};
        uint32_t seed = 10 * n;
        for (auto [p, normal] : receivers)
            check_irradiance(irradiance(view, p, normal, 400000, ++seed), 3 * polygon_irradiance(corners, p, normal));
        // Behind: nothing.
        CHECK(irradiance(view, {0, 0, 5}, {0, 0, -1}, 1000, 7).sum == 0);
    }
}

TEST_CASE("B33: a tiny and a huge rectangle light alike", "[emitter]") {
    for (float scale : {1e-4f, 1e4f}) {
        const Vec3f o = Vec3f{-1, -1, 2} * scale, ex = Vec3f{0, 2, 0} * scale, ey = Vec3f{2, 0, 0} * scale;
        Scene scene;
        add_area(scene, add_rectangle(scene, o, ex, ey, 10), splat(1));
        complete(scene);
        check_irradiance(irradiance(view_of(scene), {0, 0, 0}, {0, 0, 1}, 200000, 3),
                         polygon_irradiance({o, o + ex, o + ex + ey, o + ey}, {0, 0, 0}, {0, 0, 1}));
    }
}

TEST_CASE("A sphere lights like its projected solid angle", "[emitter]") {
    const Vec3f center = {0.4f, -0.3f, 0.8f};
    const Vec3f axis = normalize(Vec3f{1, 2, -0.5f});
    for (double ratio : {1e-4, 0.01, 0.3, 0.9, 0.999}) {
        Scene scene;
        const double r = 0.25;
        add_area(scene, add_sphere(scene, center, float(r)), splat(2));
        complete(scene);
        const Vec3f p = center - axis * float(r / ratio);
        INFO("radius over distance " << ratio);
        // The reference as rounded to float decides.
        const double d = std::sqrt(dot_d(to_double(p - center), to_double(p - center)));
        check_irradiance(irradiance(view_of(scene), p, axis, 100000, 21), 2 * M_PI * r * r / (d * d));
    }
    Scene inwards, outwards;
    add_area(inwards, add_sphere(inwards, center, 0.5f, true), splat(2));
    add_area(outwards, add_sphere(outwards, center, 0.5f), splat(2));
    complete(inwards);
    complete(outwards);
    // Inside of a sphere that radiates inwards the irradiance is pi L everywhere and for every normal.
    check_irradiance(irradiance(view_of(inwards), center, axis, 500000, 22), 2 * M_PI);
    check_irradiance(irradiance(view_of(inwards), center + axis * 0.35f, {0, 0, 1}, 900000, 23), 2 * M_PI);
    // From outside its far side is lit, whatever lets that light through the near side.
    check_irradiance(irradiance(view_of(inwards), center + axis * 0.6f, -axis, 500000, 24), 2 * M_PI * 0.25 / 0.36);
    CHECK(irradiance(view_of(outwards), center + axis * 0.3f, -axis, 1000, 25).sum == 0);
}

TEST_CASE("Sampled points of a sphere lie on it and in the sampled direction", "[emitter]") {
    for (float distance : {0.50001f, 0.5001f, 0.6f, 3.0f, 1e3f}) {
        Scene scene;
        const Vec3f center = {10, 20, -5};
        add_area(scene, add_sphere(scene, center, 0.5f), splat(1));
        complete(scene);
        const SceneView view = view_of(scene);
        const Vec3f p = center + normalize(Vec3f{1, 1, 0.3f}) * distance;
        for (uint32_t i = 0; i < 2000; ++i) {
            EmitterSample s;
            REQUIRE(sample_emitter_direct<kAll>(view, p, random(5, i), s));
            REQUIRE(std::fabs(length(s.p - center) - 0.5f) < 1e-5f);
            REQUIRE(length(s.ng - (s.p - center) * 2.0f) < 2e-5f);
            REQUIRE(length(p + s.wi * s.distance - s.p) < 1e-5f + 1e-6f * distance);
            REQUIRE(length(p - s.p) <= s.distance + 1e-5f + 1e-6f * distance);
            REQUIRE(dot(s.ng, s.wi) < 1e-3f);
        }
    }
}

TEST_CASE("Disk and cylinder light by their closed forms", "[emitter]") {
    const Vec3f axis = normalize(Vec3f{1, -0.5f, 0.7f});
    for (double h : {0.2, 1.0, 50.0}) {
        Scene scene;
        add_area(scene, add_quadric(scene, PrimitiveType::disk, 0.8f, 0.8f, axis, {1, 2, 3}), splat(1));
        complete(scene);
        check_irradiance(irradiance(view_of(scene), Vec3f{1, 2, 3} + axis * float(h), -axis, 1200000, 31),
                         M_PI * 0.64 / (0.64 + h * h));
        CHECK(irradiance(view_of(scene), Vec3f{1, 2, 3} - axis * float(h), axis, 1000, 31).sum == 0);
    }
    // From the middle of the base, the wall of an inwards radiating cylinder leaves out the cone of its far opening.
    Scene tube;
    add_area(tube, add_quadric(tube, PrimitiveType::cylinder, 0.8f, 1.5f, axis, {1, 2, 3}, true), splat(1));
    complete(tube);
    check_irradiance(irradiance(view_of(tube), {1, 2, 3}, axis, 800000, 32), M_PI * 2.25 / (2.25 + 0.64));
    // Outside of an outwards radiating one: quadrature over the wall.
    Scene lamp;
    add_area(lamp, add_quadric(lamp, PrimitiveType::cylinder, 0.3f, 2.0f, {0, 0, 1}, {0, 0, -1}), splat(1));
    complete(lamp);
    double expected = 0;
    const int n = 1000;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            const double phi = 2 * M_PI * (i + 0.5) / n, z = -1 + 2 * (j + 0.5) / n;
            const Vec3d normal = {std::cos(phi), std::sin(phi), 0};
            const Vec3d d = {0.3 * normal[0] - 1.2, 0.3 * normal[1], z - 0.1};
            const double d2 = dot_d(d, d), cos_light = -dot_d(d, normal), cos_receiver = -d[0];
            if (cos_light > 0) expected += cos_light * cos_receiver / (d2 * d2);
        }
    expected *= 2 * M_PI * 0.3 * 2 / (double(n) * n);
    check_irradiance(irradiance(view_of(lamp), {1.2f, 0, 0.1f}, {-1, 0, 0}, 800000, 33), expected);
}

TEST_CASE("A textured area light radiates its texture", "[emitter]") {
    Scene scene;
    std::vector<Rgb> colors;
    for (int i = 0; i < 16; ++i) colors.push_back(splat(float((i * 5) % 7)));
    const int32_t texture = add_texture(scene, 4, 4, colors);
    add_area(scene, add_rectangle(scene, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 3), splat(0.5f), texture);
    complete(scene);
    double expected = 0;
    const int n = 800;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            const double a = (i + 0.5) / n, b = (j + 0.5) / n;  // along ex and ey, hence u and v
            const double x = a * 4 - 0.5, y = b * 4 - 0.5;
            const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
            const auto at = [&](int cx, int cy) { return double(colors[size_t(((cy + 4) % 4) * 4 + (cx + 4) % 4)].x); };
            const double wx = x - x0, wy = y - y0;
            const double l = (1 - wy) * ((1 - wx) * at(x0, y0) + wx * at(x0 + 1, y0)) +
                             wy * ((1 - wx) * at(x0, y0 + 1) + wx * at(x0 + 1, y0 + 1));
            const Vec3d d = {-1 + 2 * b - 0.3, -1 + 2 * a - 0.2, 2};
            const double d2 = dot_d(d, d);
            expected += 0.5 * l * 4 / (d2 * d2);
        }
    expected *= 4.0 / (double(n) * n);
    check_irradiance(irradiance(view_of(scene), {0.3f, 0.2f, 0}, {0, 0, 1}, 400000, 41), expected);
}

TEST_CASE("Point, spot and directional lights follow their laws exactly; B7, B8: their delta flags", "[emitter]") {
    const Vec3f p = {1, 2, 3}, up = {0, 0, 1};
    EmitterSample s;
    {
        Scene scene;
        add_emitter(scene, EmitterType::point, {8, 4, 2}).position = {1, 5, 7};
        complete(scene);
        REQUIRE(sample_emitter_direct<kAll>(view_of(scene), p, {0.5f, 0.1f, 0.2f, 0.3f}, s));
        CHECK(s.radiance.x == Approx(8.0 / 25));
        CHECK(s.radiance.z == Approx(2.0 / 25));
        CHECK(s.distance == Approx(5));
        CHECK(dot(s.wi, up) == Approx(0.8));
        CHECK(s.delta);
        CHECK(s.pdf_sa == 1.0f);
        CHECK_FALSE(sample_emitter_direct<kAll>(view_of(scene), {1, 5, 7}, {0, 0, 0, 0}, s));
    }
    {
        Scene scene;
        add_spot(scene, {0, 0, 10}, {0, 0, -1}, 40, 20, splat(50));
        complete(scene);
        const SceneView view = view_of(scene);
        const double cases[][2] = {{0, 1},    {10, 1},   {19.9, 1}, {25, 0.75}, {30, 0.5},
                                   {38, 0.1}, {40.1, 0}, {80, 0},   {120, 0}};
        for (auto [angle, falloff] : cases) {
            const double a = angle * M_PI / 180;
            const Vec3f q = {float(4 * std::sin(a)), 0, float(10 - 4 * std::cos(a))};
            const bool lit = sample_emitter_direct<kAll>(view, q, {0.5f, 0.1f, 0.2f, 0.3f}, s);
            INFO("angle " << angle);
            CHECK(lit == (falloff > 0));
            if (!lit) continue;
            CHECK(s.radiance.x == Approx(50 * falloff / 16).epsilon(1e-4));
            CHECK(s.delta);
            CHECK(s.distance == Approx(4));
        }
        // No ramp at all: full up to the cutoff.
        Scene hard;
        add_spot(hard, {0, 0, 10}, {0, 0, -1}, 30, 30, splat(50));
        complete(hard);
        REQUIRE(sample_emitter_direct<kAll>(view_of(hard), {2, 0, 6}, {0, 0, 0, 0}, s));
        CHECK(s.radiance.x == Approx(50.0 / 20));
    }
    {
        Scene scene;
        const int32_t texture = add_texture(scene, 2, 2, {{1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {4, 4, 4}});
        scene.textures[0].filter = TextureFilter::nearest;
        Emitter& e = add_spot(scene, {0, 0, 0}, {0, 0, 1}, 45, 45, splat(1));
        e.radiance.texture = texture;
        e.to_world = e.to_local = affine_from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0});
        complete(scene);
        const float quadrants[4][3] = {{-1, -1, 1}, {1, -1, 2}, {-1, 1, 3}, {1, 1, 4}};
        for (auto q : quadrants) {
            REQUIRE(sample_emitter_direct<kAll>(view_of(scene), {q[0] * 0.5f, q[1] * 0.5f, 1}, {0, 0, 0, 0}, s));
            CHECK(s.radiance.x * 1.5f == Approx(q[2]));
        }
    }
    {
        Scene scene;
        add_emitter(scene, EmitterType::directional, splat(7)).direction = normalize(Vec3f{0, 0.6f, -0.8f});
        complete(scene);
        REQUIRE(sample_emitter_direct<kAll>(view_of(scene), p, {0.5f, 0.1f, 0.2f, 0.3f}, s));
        CHECK(s.radiance.x == 7.0f);
        CHECK(dot(s.wi, up) == Approx(0.8));
        CHECK(s.wi.y == Approx(-0.6));
        CHECK(s.distance == kInfinity);
        CHECK(length(s.p - p) >= 2 * scene.bounds_radius * 0.999f);
        CHECK(s.delta);
        CHECK(s.pdf_sa == 1.0f);
        // No other strategy finds it.
        CHECK(pdf_environment_direct<kAll>(view_of(scene), s.wi) == 0.0f);
        CHECK(is_zero(environment_radiance<kAll>(view_of(scene), s.wi)));
        SurfacePoint hit{};
        hit.ng = -s.wi;
        CHECK(pdf_emitter_direct<kAll>(view_of(scene), 0, p, s.wi, hit) == 0.0f);
        CHECK(is_zero(emitted_radiance<kAll>(view_of(scene), 0, hit, -s.wi)));
    }
}

TEST_CASE("Constant environment and environment maps light a plane as the integral says", "[emitter]") {
    Scene sky;
    add_emitter(sky, EmitterType::constant, splat(1.5f));
    complete(sky);
    check_irradiance(irradiance(view_of(sky), {3, 4, 5}, {0, 1, 0}, 600000, 51), 1.5 * M_PI);
    CHECK(environment_radiance<kAll>(view_of(sky), {0, 0, 1}).x == 1.5f);

    const int w = 16, h = 9;
    const auto image = test_sky(w, h);
    const Affine rotation = rotation_to({0.3f, -0.8f, 0.5f});
    Scene scene;
    add_envmap(scene, w, h, image, splat(2), rotation);
    complete(scene);
    const SceneView view = view_of(scene);
    for (Vec3f n : {Vec3f{0, 1, 0}, Vec3f{0, -1, 0}, normalize(Vec3f{1, -0.4f, 0.3f})}) {
        const Vec3f local = scene.emitters[0].to_local.vector(n);
        check_irradiance(irradiance(view, {0, 0, 0}, n, 2000000, 52),
                         2 * env_irradiance(image, w, h, to_double(local)));
    }
    // One texel lit in a black map, on a pole too: light bleeds into the cells around it, which must stay reachable.
    for (auto [column, row] : {std::pair{3, 4}, std::pair{0, 4}, std::pair{7, 0}, std::pair{15, 8}}) {
        std::vector<Rgb> dark(size_t(w * h), Rgb{0, 0, 0});
        dark[size_t(row * w + column)] = splat(10);
        Scene lamp;
        add_envmap(lamp, w, h, dark, splat(1), rotation_to({0, 0, 1}));
        complete(lamp);
        const double phi = 2 * M_PI * (column + 0.5) / w, theta = M_PI * row / (h - 1);
        const Vec3f local = {float(std::sin(phi) * std::sin(theta)), float(std::cos(theta)),
                             float(-std::cos(phi) * std::sin(theta))};
        check_irradiance(irradiance(view_of(lamp), {0, 0, 0}, lamp.emitters[0].to_world.vector(local), 800000, 53),
                         env_irradiance(dark, w, h, to_double(local)));
    }
}

TEST_CASE("Orientation of the environment map is Mitsuba's", "[emitter]") {
    // Values measured with Mitsuba 3.9 on an 8 x 4 map whose texel (i,j) is (i,j,1).
    std::vector<Rgb> image;
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 8; ++i) image.push_back({float(i), float(j), 1});
    Scene scene;
    add_envmap(scene, 8, 4, image, splat(1), affine_from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}));
    complete(scene);
    const SceneView view = view_of(scene);
    const struct {
        Vec3f d;
        float x, y;
    } cases[] = {{{0, 1, 0}, 3.5f, 0},
                 {{0, -1, 0}, 3.5f, 3},
                 {{0, 0, -1}, 3.5f, 1.5f},
                 {{0, 0, 1}, 3.5f, 1.5f},
                 {{1, 0, 0}, 1.5f, 1.5f},
                 {{-1, 0, 0}, 5.5f, 1.5f},
                 {{0, 0.5f, -0.8660254f}, 3.5f, 1.0f},
                 {{0, 0.92387953f, 0.38268343f}, 3.5f, 0.375f}};
    for (const auto& c : cases) {
        const Rgb value = environment_radiance<kAll>(view, c.d);
        INFO("direction " << c.d.x << " " << c.d.y << " " << c.d.z);
        if (std::fabs(c.d.y) < 1) CHECK(value.x == Approx(c.x).margin(1e-4));
        CHECK(value.y == Approx(c.y).margin(1e-4));
        CHECK(value.z == Approx(1));
    }
}

TEST_CASE("B10: lights together give the sum of the lights alone, however they are picked", "[emitter]") {
    const Vec3f o = {-1, -1, 2}, ex = {0, 2, 0}, ey = {2, 0, 0}, p = {0, 0, 0}, n = {0, 0, 1};
    Scene scene;
    add_area(scene, add_rectangle(scene, o, ex, ey, 2), splat(1));
    const uint32_t ball = add_sphere(scene, {0, 4, 3}, 1);
    add_area(scene, ball, splat(4));
    add_emitter(scene, EmitterType::point, splat(6)).position = {0, 3, 4};
    add_spot(scene, {3, 0, 4}, {-3, 0, -4}, 30, 10, splat(5));
    add_emitter(scene, EmitterType::directional, splat(0.5f)).direction = {0, 0, -1};
    add_emitter(scene, EmitterType::constant, splat(0.25f));
    const double expected[] = {polygon_irradiance({o, o + ex, o + ex + ey, o + ey}, p, n),
                               4 * M_PI / 25 * 0.6,
                               6.0 / 25 * 0.8,
                               5.0 / 25 * 0.8,
                               0.5,
                               0.25 * M_PI};
    double total = 0;
    for (double e : expected) total += e;
    for (const std::vector<double>& weights :
         {std::vector<double>{}, std::vector<double>{4, 50, 75, 3, 157, 79}, std::vector<double>{1, 2, 3, 4, 5, 60}}) {
        Scene s = scene;
        complete(s, weights);
        check_irradiance(irradiance(view_of(s), p, n, 2500000, 61), total);
    }
    // Every pair.
    for (uint32_t a = 0; a < 6; ++a)
        for (uint32_t b = a + 1; b < 6; ++b) {
            Scene s = scene;
            std::vector<double> weights(6, 0.0);
            weights[a] = 3;
            weights[b] = 1;
            complete(s, weights);
            INFO("emitters " << a << " and " << b);
            check_irradiance(irradiance(view_of(s), p, n, 1500000, 62 + 6 * a + b), expected[a] + expected[b]);
        }
    Scene none;
    complete(none);
    EmitterSample s;
    CHECK_FALSE(sample_emitter_direct<kAll>(view_of(none), p, {0.5f, 0.5f, 0.5f, 0.5f}, s));
}
