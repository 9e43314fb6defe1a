// libs: ambilux_scene ambilux_core
// The film of all directions: rays against Mitsuba 0.6's formulas, importance against the rays that it stands for, and
// a film without edges.
#include "tests/support/catch.h"
#include "tests/support/chi_square.h"
#include "tests/support/emitter_scene.h"
#include "transport/sensor.h"
#include "transport/subpath/camera_connection.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features F = kAllFeatures;

/// A camera at (1,2,3) that looks at (0,0.5,-1); the film is 30 x 16 pixels.
Sensor spherical_sensor() {
    Sensor s{};
    s.type = SensorType::spherical;
    const Vec3f origin = {1, 2, 3}, axis = normalize(Vec3f{0, 0.5f, -1} - origin),
                left = normalize(cross(Vec3f{0, 1, 0}, axis)), up = cross(axis, left);
    s.to_world = affine_from_columns(left, up, axis, origin);
    s.film_width = s.crop_width = 30;
    s.film_height = s.crop_height = 16;
    s.far_clip = kInfinity;
    s.filter_radius = 0.5f;
    return s;
}

/// The same where camera space is the world's.
Sensor unturned() {
    Sensor s = spherical_sensor();
    s.to_world = affine_from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0});
    return s;
}

Vec3f direction(const Sensor& s, Vec2f film) { return sample_camera_ray<F>(s, film, {0.5f, 0.5f}).d; }

double solid_angle_of_row(const Sensor& s, uint32_t y) {
    return 2 * M_PI / s.film_width * (std::cos(M_PI * y / s.film_height) - std::cos(M_PI * (y + 1) / s.film_height));
}

std::vector<Vec2f> positions(const Sensor& s, Vec2f film) {
    std::vector<Vec2f> all;
    for_each_film_position<F>(s, film, [&](Vec2f at) { all.push_back(at); });
    return all;
}

}  // namespace

TEST_CASE("Rays are Mitsuba 0.6's: sin x sin y, cos y, -cos x sin y", "[sensor]") {
    const Sensor s = unturned();
    const struct {
        Vec2f film;
        Vec3f d;
    } cases[] = {{{15, 8}, {0, 0, 1}},     {{0, 8}, {0, 0, -1}}, {{7.5f, 8}, {1, 0, 0}},
                 {{22.5f, 8}, {-1, 0, 0}}, {{4, 0}, {0, 1, 0}},  {{4, 16}, {0, -1, 0}}};
    for (const auto& c : cases) {
        const CameraSample ray = sample_camera_ray<F>(s, c.film, {0.3f, 0.8f});
        CHECK(length(ray.d - c.d) < 1e-6f);
        CHECK(length(ray.o) == 0);
        CHECK(ray.tmax == kInfinity);
    }
    for (uint32_t i = 0; i < 500; ++i) {
        const Vec4f u = random(3, i);
        const double x = 2 * M_PI * double(u.x), y = M_PI * double(u.y);
        const Vec3f expected = {float(std::sin(x) * std::sin(y)), float(std::cos(y)),
                                float(-std::cos(x) * std::sin(y))};
        REQUIRE(length(direction(s, {u.x * 30, u.y * 16}) - expected) < 2e-6f);
    }
    // Right on the film is right of a viewer who looks along the axis, whose left is +x; up is up.
    const Sensor turned = spherical_sensor();
    const Vec3f axis = turned.to_world.vector({0, 0, 1});
    CHECK(length(direction(turned, {15, 8}) - axis) < 1e-6f);
    CHECK(dot(direction(turned, {16, 8}), turned.to_world.vector({1, 0, 0})) < 0);
    CHECK(dot(direction(turned, {15, 7}), turned.to_world.vector({0, 1, 0})) > 0);
}

TEST_CASE("Pixels cover all directions, and each has importance one", "[sensor]") {
    const Sensor s = spherical_sensor();
    double sphere = 0;
    for (uint32_t y = 0; y < s.film_height; ++y) {
        sphere += s.film_width * solid_angle_of_row(s, y);
        // The integral of the density over the solid angle of a pixel, by the sine of its rows.
        double importance = 0;
        const int n = 2000;
        for (int i = 0; i < n; ++i) {
            const double sine = std::sin(M_PI * (y + (i + 0.5) / n) / s.film_height);
            importance += double(camera_importance<F>(s, float(sine))) * sine * M_PI / s.film_height / n;
        }
        CHECK(importance * 2 * M_PI / s.film_width == Approx(1).epsilon(1e-5));
    }
    CHECK(sphere == Approx(4 * M_PI));
    CHECK(camera_delta_position(s));
    CHECK_FALSE(camera_delta_direction(s));
    CHECK(camera_pdf_position(s) == 1);
    for (uint32_t i = 0; i < 500; ++i) {
        const Vec4f u = random(21, i);
        const Vec2f film = {u.x * 30, 0.2f + u.y * 15.6f};
        const float h = 0.02f;
        const Vec3f d = direction(s, film);
        const Vec3f dx = direction(s, {film.x + h, film.y}) - direction(s, {film.x - h, film.y});
        const Vec3f dy = direction(s, {film.x, film.y + h}) - direction(s, {film.x, film.y - h});
        const double solid_angle = double(length(cross(dx, dy))) / (4 * double(h) * double(h));
        REQUIRE(camera_pdf_direction_sa<F>(s, camera_cosine<F>(s, d)) == Approx(1 / solid_angle).epsilon(2e-3));
    }
}

TEST_CASE("Sampled directions have the density that is claimed: chi-square over parts of the sphere", "[sensor]") {
    const Sensor s = spherical_sensor();
    constexpr int kPhi = 12, kCos = 10, kSamples = 400000;
    std::vector<double> observed(kPhi * kCos), expected(kPhi * kCos);
    for (int k = 0; k < kSamples; ++k) {
        const Vec4f u = random(22, uint32_t(k));
        const Vec3f d = world_to_camera_vector(s, direction(s, {u.x * 30, u.y * 16}));
        const double turn = std::atan2(double(d.z), double(d.x)) / (2 * M_PI) + 0.5;
        const int i = std::min(int(turn * kPhi), kPhi - 1), j = std::min(int((double(d.y) + 1) / 2 * kCos), kCos - 1);
        observed[size_t(j * kPhi + i)] += 1;
    }
    for (int j = 0; j < kCos; ++j)
        for (int i = 0; i < kPhi; ++i) {
            // The claimed density over a part, all pixels together: it depends on the sine alone.
            double sum = 0;
            const int n = 4000;
            const double a = std::acos(2.0 * (j + 1) / kCos - 1), b = std::acos(2.0 * j / kCos - 1);
            for (int k = 0; k < n; ++k) {
                const double sine = std::sin(a + (b - a) * (k + 0.5) / n);
                sum += double(camera_pdf_direction_sa<F>(s, float(sine))) * sine * (b - a) / n;
            }
            expected[size_t(j * kPhi + i)] = sum * 2 * M_PI / kPhi / (30 * 16) * kSamples;
        }
    const ChiSquare test = chi_square(observed, expected);
    INFO(test.statistic);
    CHECK(test.p_value > 1e-4);
}

TEST_CASE("B21: a point of a camera ray is seen where the ray came from", "[sensor]") {
    const Sensor s = spherical_sensor();
    for (uint32_t i = 0; i < 2000; ++i) {
        const Vec4f u = random(11, i);
        const Vec2f film = {u.x * 30, u.y * 16};
        const CameraSample ray = sample_camera_ray<F>(s, film, {0.5f, 0.5f});
        const float distance = 0.01f + 50 * u.z * u.z;
        const Vec3f p = ray.o + ray.d * distance;
        CameraConnection c;
        REQUIRE(connect_to_camera<F>(s, p, {0.5f, 0.5f}, c));
        // Places of one row lie close to each other near the poles.
        const float sine = camera_cosine<F>(s, ray.d), turn = std::fabs(c.film_position.x - film.x);
        REQUIRE(std::min(turn, 30 - turn) * sine < 2e-3f);
        REQUIRE(std::fabs(c.film_position.y - film.y) < 2e-3f);
        REQUIRE(length(c.wi + ray.d) < 1e-3f);
        REQUIRE(c.distance == Approx(distance).epsilon(1e-3));
        REQUIRE(c.camera_distance == c.distance);
        REQUIRE(c.weight == Approx(camera_pdf_direction_sa<F>(s, c.cos_camera) / (c.distance * c.distance)));
    }
    CameraConnection c;
    CHECK_FALSE(connect_to_camera<F>(unturned(), {0, 2, 0}, {0.5f, 0.5f}, c));  // a pole
    CHECK_FALSE(connect_to_camera<F>(unturned(), {0, 0, 0}, {0.5f, 0.5f}, c));
}

TEST_CASE("Beyond the edges lies what is seen on the other side", "[sensor]") {
    Sensor s = spherical_sensor();
    s.filter_radius = 2;
    for (uint32_t i = 0; i < 2000; ++i) {
        const Vec4f u = random(41, i);
        const Vec2f film = {u.x * 34 - 2, u.y * 20 - 2};
        const Vec3f d = direction(s, film);
        const Vec2f seen = latlong_film(s, world_to_camera_vector(s, d));
        REQUIRE((seen.x >= 0 && seen.x <= 30 && seen.y >= 0 && seen.y <= 16));
        bool found = false;
        for (const Vec2f& at : positions(s, seen)) {
            REQUIRE(length(direction(s, at) - d) < 2e-5f);
            REQUIRE((at.x > -3 && at.x < 33 && at.y > -3 && at.y < 19));
            found |= std::fabs(at.x - film.x) * camera_cosine<F>(s, d) < 1e-2f && std::fabs(at.y - film.y) < 1e-2f;
        }
        REQUIRE(found);
    }
    CHECK(positions(s, {15, 8}).size() == 1);
    CHECK(positions(s, {1, 8}).size() == 2);
    CHECK(positions(s, {15, 1}).size() == 3);  // over the pole both ends of a row
    s.type = SensorType::perspective;
    CHECK(positions(s, {1, 8}).size() == 1);
}

TEST_CASE("No light is lost at the edges of the film, and none counts twice", "[sensor]") {
    Scene scene;
    scene.sensor = spherical_sensor();
    scene.sensor.filter = FilterType::tent;
    for (const auto& [w, h] : {std::pair{30u, 16u}, {7u, 5u}, {3u, 1u}, {1u, 1u}})
        for (const float radius : {0.5f, 1.0f, 2.5f}) {
            Sensor& s = scene.sensor;
            s.film_width = s.crop_width = w;
            s.film_height = s.crop_height = h;
            s.filter_radius = radius;
            const SceneView view = view_of(scene);
            // The sum of what pixels see of a place is, over all directions, one per pixel.
            Statistics sum;
            for (uint32_t i = 0; i < 4000; ++i) {
                const Vec4f u = random(51, i);
                const Vec2f film = {u.x * float(w), u.y * float(h)};
                double counted = 0;
                for_each_film_position<F>(s, film, [&](Vec2f at) {
                    for (uint32_t y = 0; y < h; ++y)
                        for (uint32_t x = 0; x < w; ++x)
                            counted += double(filter_value(view, {at.x - float(x) - 0.5f, at.y - float(y) - 0.5f}));
                });
                sum.add(counted);
                // A tent of a whole radius adds up to one everywhere.
                if (radius == 1.0f) REQUIRE(counted == Approx(1).epsilon(1e-4));
                REQUIRE(reaches_pixels<F>(s, film));
            }
            INFO(w << " x " << h << ", radius " << radius << ": " << sum.mean() << " +- " << sum.standard_error());
            CHECK(std::fabs(sum.mean() - 1) < 4.5 * sum.standard_error() + 1e-4);
        }
}

TEST_CASE("A crop is reached over the edges too", "[sensor]") {
    Sensor s = spherical_sensor();
    s.filter_radius = 1.5f;
    s.crop_width = 3, s.crop_height = 4, s.crop_y = 6;
    CHECK(reaches_pixels<F>(s, {2, 8}));
    CHECK(reaches_pixels<F>(s, {29.5f, 8}));
    CHECK_FALSE(reaches_pixels<F>(s, {28.5f, 8}));
    CHECK_FALSE(reaches_pixels<F>(s, {2, 1}));
    s.crop_y = 0, s.crop_x = 14;
    CHECK(reaches_pixels<F>(s, {0.5f, 0.5f}));  // over the pole
    CHECK_FALSE(reaches_pixels<F>(s, {0.5f, 2.5f}));
}

TEST_CASE("B14, B21: light carried to the camera measures what camera rays see, all around", "[sensor]") {
    // A sphere of radiance 1 around the camera, which is not in its middle: points uniform on it.
    const Sensor s = spherical_sensor();
    const Vec3f center = {1.3f, 1.8f, 2.6f};
    const float radius = 1.5f;
    std::vector<Statistics> rows(s.film_height);
    for (uint32_t i = 0; i < 600000; ++i) {
        const Vec4f u = random(31, i);
        const float z = 2 * u.x - 1, r = std::sqrt(std::max(0.0f, 1 - z * z)), phi = float(2 * M_PI) * u.y;
        const Vec3f n = {r * std::cos(phi), r * std::sin(phi), z};
        CameraConnection c;
        REQUIRE(connect_to_camera<F>(s, center + n * radius, {0.5f, 0.5f}, c));
        const double flux = 4 * M_PI * double(radius) * double(radius);
        const double value = double(c.weight) * std::fabs(double(dot(n, c.wi))) * flux;
        const uint32_t row = std::min(uint32_t(c.film_position.y), s.film_height - 1);
        for (uint32_t y = 0; y < s.film_height; ++y) rows[y].add(y == row ? value / s.film_width : 0.0);
    }
    for (const Statistics& row : rows) {
        INFO(row.mean() << " +- " << row.standard_error());
        CHECK(std::fabs(row.mean() - 1) < 4.5 * row.standard_error());
        CHECK(row.standard_error() < 0.04);  // that of the poles, which see few points
    }
}
