// libs: ambilux_scene ambilux_core
// Sensors: rays against Mitsuba's, filters by their moments, and B21: the camera's importance against the rays it
// stands for.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/sensor.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// The look-at camera of the tests: from (1,2,3) to (0,0.5,-1), 40 degrees along x, 30 x 20 pixels.
Sensor make_sensor(SensorType type, float scale = 1.0f) {
    Sensor s{};
    s.type = type;
    const Vec3f origin = {1, 2, 3}, axis = normalize(Vec3f{0, 0.5f, -1} - origin),
                left = normalize(cross(Vec3f{0, 1, 0}, axis)), up = cross(axis, left);
    s.to_world = affine_from_columns(left * scale, up * scale, axis, origin);
    s.film_width = 30;
    s.film_height = 20;
    s.crop_width = 30;
    s.crop_height = 20;
    const float t = type == SensorType::orthographic ? 1.0f : float(std::tan(20 * M_PI / 180));
    s.tan_half_fov = {t, t * 20 / 30};
    s.near_clip = 0.5f;
    s.far_clip = 100;
    s.aperture_radius = 0.3f;
    s.focus_distance = 4;
    return s;
}

/// The cameras under test, one per SensorType, among them a principal point off the centre and a scaled orthographic
/// one.
std::vector<Sensor> all_sensors() {
    std::vector<Sensor> sensors = {make_sensor(SensorType::perspective), make_sensor(SensorType::thin_lens),
                                   make_sensor(SensorType::orthographic, 2.0f)};
    sensors.push_back(sensors[0]);
    sensors.back().principal_offset = {0.1f, -0.2f};
    sensors.push_back(sensors[1]);
    sensors.back().principal_offset = {-0.3f, 0.1f};
    return sensors;
}

Vec3f axis_of(const Sensor& s) { return normalize(s.to_world.vector({0, 0, 1})); }
Vec3f origin_of(const Sensor& s) { return {s.to_world.m[0][3], s.to_world.m[1][3], s.to_world.m[2][3]}; }

/// Appends the inverse cumulative table of a filter given by its density on [-radius, radius].
uint32_t append_filter(Scene& s, double radius, const std::function<double(double)>& density) {
    const int n = 200000;
    std::vector<double> cdf(size_t(n + 1), 0.0);
    for (int i = 0; i < n; ++i) cdf[size_t(i + 1)] = cdf[size_t(i)] + density(-radius + 2 * radius * (i + 0.5) / n);
    const uint32_t offset = uint32_t(s.tables.size());
    size_t k = 0;
    for (uint32_t i = 0; i <= kFilterTableSize; ++i) {
        const double target = cdf[size_t(n)] * i / kFilterTableSize;
        while (k < size_t(n) - 1 && cdf[k + 1] < target) ++k;
        const double step = cdf[k + 1] - cdf[k];
        s.tables.push_back(float(-radius + 2 * radius * (double(k) + (step > 0 ? (target - cdf[k]) / step : 0)) / n));
    }
    append_filter_guide(s.tables);
    return offset;
}

}  // namespace

TEST_CASE("Camera rays are Mitsuba's", "[sensor]") {
    // Measured with Mitsuba 3.9, scalar_rgb: sample_ray at aperture sample (0.3, 0.8).
    const struct {
        SensorType type;
        Vec2f film;
        Vec3f o, d;
        float tmax;
    } cases[] = {
        {SensorType::perspective,
         {3.5f, 4.5f},
         {0.776437f, 1.93737f, 2.53094f},
         {-0.427159f, -0.119664f, -0.896223f},
         104.15116f},
        {SensorType::perspective,
         {25.25f, 17.75f},
         {1.04577f, 1.7863f, 2.52026f},
         {0.0868134f, -0.405361f, -0.910025f},
         104.90747f},
        {SensorType::thin_lens,
         {3.5f, 4.5f},
         {0.810239f, 2.01995f, 2.49152f},
         {-0.503744f, -0.241328f, -0.82946f},
         104.34965f},
        {SensorType::thin_lens,
         {25.25f, 17.75f},
         {1.07957f, 1.86888f, 2.48084f},
         {0.00986755f, -0.528735f, -0.84873f},
         104.48502f},
        {SensorType::orthographic,
         {3.5f, 4.5f},
         {-0.662319f, 2.5182f, 2.67282f},
         {-0.227921f, -0.341882f, -0.911685f},
         99.5f},
        {SensorType::orthographic,
         {25.25f, 17.75f},
         {2.29758f, 0.857992f, 2.55542f},
         {-0.227921f, -0.341882f, -0.911685f},
         99.5f},
    };
    for (const auto& c : cases) {
        Sensor s = make_sensor(c.type, c.type == SensorType::orthographic ? 2.0f : 1.0f);
        if (c.type == SensorType::perspective) s.principal_offset = {0.1f, -0.2f};
        const CameraSample ray = sample_camera_ray<kAllFeatures>(s, c.film, {0.3f, 0.8f});
        INFO("sensor type " << uint32_t(c.type));
        CHECK(length(ray.o - c.o) < 2e-5f);
        CHECK(length(ray.d - c.d) < 2e-5f);
        CHECK(ray.tmax == Approx(c.tmax).epsilon(1e-5));
        // Both ends lie on the clip planes.
        CHECK(dot(ray.o - origin_of(s), axis_of(s)) == Approx(0.5));
        CHECK(dot(ray.o + ray.d * ray.tmax - origin_of(s), axis_of(s)) == Approx(100));
    }
}

TEST_CASE("The image is not mirrored: right on the film is right of the viewer, down is down", "[sensor]") {
    Sensor s = make_sensor(SensorType::perspective);
    // At the origin, looking along -z with y up: the viewer's right is +x.
    s.to_world = affine_from_columns({-1, 0, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 0});
    const Vec3f top_left = sample_camera_ray<kAllFeatures>(s, {0, 0}, {0, 0}).d,
                bottom_right = sample_camera_ray<kAllFeatures>(s, {30, 20}, {0, 0}).d;
    CHECK(top_left.x < 0);
    CHECK(top_left.y > 0);
    CHECK(bottom_right.x > 0);
    CHECK(bottom_right.y < 0);
    CHECK(sample_camera_ray<kAllFeatures>(s, {15, 10}, {0, 0}).d.z == Approx(-1));
    CHECK(bottom_right.x / -bottom_right.z == Approx(std::tan(20 * M_PI / 180)));
}

TEST_CASE("A thin lens is sharp at its focus distance and a pinhole in the limit", "[sensor]") {
    const Sensor lens = make_sensor(SensorType::thin_lens), pinhole = make_sensor(SensorType::perspective);
    const Vec2f film = {7.3f, 16.1f};
    const CameraSample central = sample_camera_ray<kAllFeatures>(pinhole, film, {0.5f, 0.5f});
    const Vec3f focus = central.o + central.d * ((4 - 0.5f) / dot(central.d, axis_of(lens)));
    Statistics radius2;
    for (uint32_t i = 0; i < 20000; ++i) {
        const Vec4f u = random(3, i);
        const CameraSample ray = sample_camera_ray<kAllFeatures>(lens, film, {u.x, u.y});
        const float t = (4 - 0.5f) / dot(ray.d, axis_of(lens));
        REQUIRE(length(ray.o + ray.d * t - focus) < 1e-5f);
        const Vec3f on_lens = ray.o - ray.d * (0.5f / dot(ray.d, axis_of(lens)));
        radius2.add(length_squared(on_lens - origin_of(lens)));
    }
    // Uniform over the aperture: E r² = R²/2.
    CHECK(std::fabs(radius2.mean() - 0.045) < 4.5 * radius2.standard_error() + 1e-6);
    Sensor tiny = lens;
    tiny.aperture_radius = 0;
    CHECK(length(sample_camera_ray<kAllFeatures>(tiny, film, {0.9f, 0.1f}).d - central.d) < 1e-6f);
    CHECK(camera_delta_position(tiny));
    CHECK(camera_importance<kAllFeatures>(tiny, 0.9f) == camera_importance<kAllFeatures>(pinhole, 0.9f));
}

TEST_CASE("B21: projecting a point of a camera ray gives the film position back", "[sensor]") {
    for (const Sensor& s : all_sensors())
        for (uint32_t i = 0; i < 2000; ++i) {
            const Vec4f u = random(11, i), w = random(11, i, 1);
            const Vec2f film = {u.x * 30, u.y * 20}, lens_u = {u.z, u.w};
            const CameraSample ray = sample_camera_ray<kAllFeatures>(s, film, lens_u);
            const Vec3f p = ray.o + ray.d * (w.x * w.x * ray.tmax * 0.99f + 1e-3f);
            Vec2f back = {};
            REQUIRE(project_to_film<kAllFeatures>(s, p, lens_point(s, lens_u), back));
            REQUIRE(std::fabs(back.x - film.x) < 1e-3f);
            REQUIRE(std::fabs(back.y - film.y) < 1e-3f);
            CameraConnection c;
            REQUIRE(connect_to_camera<kAllFeatures>(s, p, lens_u, c));
            REQUIRE(std::fabs(c.film_position.x - film.x) < 1e-3f);
            REQUIRE(length(c.wi + ray.d) < 1e-4f);
            REQUIRE(length(p + c.wi * c.distance - ray.o) < 1e-4f * (1 + c.distance));
            // Past the clip planes there is nothing.
            REQUIRE_FALSE(project_to_film<kAllFeatures>(s, ray.o - ray.d * 1e-3f, lens_point(s, lens_u), back));
            REQUIRE_FALSE(connect_to_camera<kAllFeatures>(s, ray.o - ray.d * 2.0f, lens_u, c));
            REQUIRE_FALSE(
                project_to_film<kAllFeatures>(s, ray.o + ray.d * (ray.tmax * 1.01f), lens_point(s, lens_u), back));
        }
}

TEST_CASE("B21: sampled directions have the density that is claimed, and We integrates to one per pixel", "[sensor]") {
    for (Sensor s : all_sensors()) {
        if (camera_delta_direction(s)) continue;
        // Wide, so that the powers of the cosine matter.
        s.tan_half_fov = {1.6f, 1.1f};
        // Density of the direction through a film position by its Jacobian: the solid angle that a small square of film
        // covers.
        for (uint32_t i = 0; i < 500; ++i) {
            const Vec4f u = random(21, i);
            const Vec2f lens_u = {u.z, u.w}, film = {u.x * 30, u.y * 20};
            const float h = 0.05f;
            const Vec3f d = sample_camera_ray<kAllFeatures>(s, film, lens_u).d;
            const Vec3f dx = sample_camera_ray<kAllFeatures>(s, {film.x + h, film.y}, lens_u).d -
                             sample_camera_ray<kAllFeatures>(s, {film.x - h, film.y}, lens_u).d;
            const Vec3f dy = sample_camera_ray<kAllFeatures>(s, {film.x, film.y + h}, lens_u).d -
                             sample_camera_ray<kAllFeatures>(s, {film.x, film.y - h}, lens_u).d;
            const double solid_angle = double(length(cross(dx, dy))) / (4 * h * h);  // per pixel
            REQUIRE(camera_pdf_direction_sa<kAllFeatures>(s, dot(d, axis_of(s))) ==
                    Approx(1 / solid_angle).epsilon(2e-3));
        }
        // Over all directions: one per pixel of the film; We with the lens and the cosine likewise.
        Statistics pdf, importance;
        const Vec2f lens_u = {0.3f, 0.6f};
        for (uint32_t i = 0; i < 600000; ++i) {
            const Vec4f u = random(22, i);
            const Vec3f local = {(2 * u.x - 1), (2 * u.y - 1), 0};
            // Directions uniform over a square of the plane z = 1 that holds the film as seen from the lens.
            const float half = 4.0f;
            const Vec3f d = normalize(s.to_world.vector({local.x * half, local.y * half, 1}));
            const float cosine = dot(d, axis_of(s));
            const double density = 1 / (4.0 * half * half * cosine * cosine * cosine);  // per solid angle
            const Vec2f lens = lens_point(s, lens_u);
            const Vec3f p = s.to_world.point({lens.x, lens.y, 0}) + d * (10 / cosine);
            Vec2f film;
            double a = 0, b = 0;
            if (project_to_film<kAllFeatures>(s, p, lens, film) && film.x >= 0 && film.y >= 0 && film.x < 30 &&
                film.y < 20) {
                a = camera_pdf_direction_sa<kAllFeatures>(s, cosine) / density;
                // The lens is uniform: its area times the density of this point is one.
                b = camera_importance<kAllFeatures>(s, cosine) * cosine / density / camera_pdf_position(s);
            }
            pdf.add(a / 600);
            importance.add(b / 600);
        }
        CHECK(std::fabs(pdf.mean() - 1) < 4.5 * pdf.standard_error());
        CHECK(std::fabs(importance.mean() - 1) < 4.5 * importance.standard_error());
        CHECK(pdf.standard_error() * 4.5 < 0.02);
        // The identity that gives camera rays the weight 1.
        CHECK(camera_importance<kAllFeatures>(s, 0.7f) * 0.7f ==
              Approx(camera_pdf_position(s) * camera_pdf_direction_sa<kAllFeatures>(s, 0.7f)));
        CHECK(camera_importance<kAllFeatures>(s, -0.1f) == 0);
    }
}

TEST_CASE("B14, B21: light carried to the camera measures what camera rays see", "[sensor]") {
    // A Lambertian plane of radiance 1, tilted: whatever the film position, rays see 1. Points uniform over the plane,
    // connected to the camera, must give the same per pixel: their flux is L dA, a splat L cos(reference) weight.
    for (const Sensor& s : all_sensors()) {
        const CameraSample middle = sample_camera_ray<kAllFeatures>(s, {15, 10}, {0.5f, 0.5f});
        const Vec3f center = middle.o + middle.d * 6.0f, n = normalize(axis_of(s) * -1.0f + Vec3f{0.5f, 0.3f, 0.1f});
        const Frame frame = frame_from_normal(n);
        const float half = 3.0f;
        // Pixels 10..19 x 6..13 wholly see the square.
        std::vector<Statistics> pixels(4);
        Statistics all;
        for (uint32_t i = 0; i < 1300000; ++i) {
            const Vec4f u = random(31, i), w = random(31, i, 1);
            const Vec3f p = center + frame.s * (half * (2 * u.x - 1)) + frame.t * (half * (2 * u.y - 1));
            CameraConnection c;
            double value = 0;
            int quadrant = -1;
            if (connect_to_camera<kAllFeatures>(s, p, {w.x, w.y}, c) && c.film_position.x >= 10 &&
                c.film_position.x < 20 && c.film_position.y >= 6 && c.film_position.y < 14) {
                value = double(c.weight) * std::max(0.0f, dot(n, c.wi)) * (4.0 * half * half) / 80;
                quadrant = (c.film_position.x >= 15 ? 1 : 0) + (c.film_position.y >= 10 ? 2 : 0);
            }
            all.add(value);
            for (int q = 0; q < 4; ++q) pixels[size_t(q)].add(q == quadrant ? 4 * value : 0.0);
        }
        INFO("sensor type " << uint32_t(s.type) << ": " << all.mean() << " +- " << all.standard_error());
        CHECK(std::fabs(all.mean() - 1) < 4.5 * all.standard_error());
        CHECK(all.standard_error() * 4.5 < 0.02);
        for (const Statistics& q : pixels) CHECK(std::fabs(q.mean() - 1) < 4.5 * q.standard_error());
    }
}

TEST_CASE("Filters: samples have the filter's moments, its value is their density", "[sensor]") {
    Scene scene;
    scene.sensor = make_sensor(SensorType::perspective);
    scene.tables.resize(3, 0.0f);
    const double sigma = 0.5, radius = 4 * sigma, lowest = std::exp(-radius * radius / (2 * sigma * sigma));
    const struct {
        FilterType type;
        double r;
        std::function<double(double)> density;
    } filters[] = {
        {FilterType::box, 0.5, [](double) { return 1.0; }},
        {FilterType::tent, 1.0, [](double x) { return 1 - std::fabs(x); }},
        {FilterType::tent, 2.5, [](double x) { return 1 - std::fabs(x) / 2.5; }},
        {FilterType::gaussian, radius, [&](double x) { return std::exp(-x * x / (2 * sigma * sigma)) - lowest; }},
    };
    for (const auto& [type, r, density] : filters) {
        scene.sensor.filter = type;
        scene.sensor.filter_radius = float(r);
        scene.sensor.filter_table = append_filter(scene, r, density);
        const SceneView view = view_of(scene);
        double total = 0;
        const int n = 100000;
        for (int i = 0; i < n; ++i) total += density(-r + 2 * r * (i + 0.5) / n);
        // Moments of a table, uniform between its entries, which stretches the last thousandth of a tail; those of box
        // and tent are right for their closed forms to 1e-5.
        const float* table = view.tables + view.sensor.filter_table;
        double second = 0, fourth = 0;
        for (uint32_t i = 0; i < kFilterTableSize; ++i) {
            const double a = table[i], b = table[i + 1];
            second += (a * a + a * b + b * b) / 3 / kFilterTableSize;
            fourth +=
                (a * a * a * a + a * a * a * b + a * a * b * b + a * b * b * b + b * b * b * b) / 5 / kFilterTableSize;
        }
        Statistics x1, x2, x4, y1, y2, xy;
        for (uint32_t i = 0; i < 200000; ++i) {
            const Vec4f u = random(41, i);
            const Vec2f o = sample_filter_offset(view, {u.x, u.y});
            REQUIRE((std::fabs(o.x) <= r && std::fabs(o.y) <= r));
            x1.add(o.x);
            y1.add(o.y);
            x2.add(double(o.x) * o.x);
            y2.add(double(o.y) * o.y);
            x4.add(std::pow(double(o.x), 4));
            xy.add(double(o.x) * o.y);
        }
        INFO("filter radius " << r);
        CHECK(std::fabs(x1.mean()) < 4.5 * x1.standard_error());
        CHECK(std::fabs(y1.mean()) < 4.5 * y1.standard_error());
        CHECK(std::fabs(x2.mean() - second) < 4.5 * x2.standard_error());
        CHECK(std::fabs(y2.mean() - second) < 4.5 * y2.standard_error());
        CHECK(std::fabs(x4.mean() - fourth) < 4.5 * x4.standard_error());
        CHECK(std::fabs(xy.mean()) < 4.5 * xy.standard_error());
        // Value: density at the centre and an integral of one.
        const double norm = total * 2 * r / n;
        for (double x : {0.013, -0.21, 0.37})
            CHECK(filter_value(view, {float(x), 0.11f}) ==
                  Approx(density(x) * density(0.11) / (norm * norm)).epsilon(0.01));
        double integral = 0;
        for (int i = 0; i < n; ++i) integral += filter_value_1d(view, float(-r + 2 * r * (i + 0.5) / n));
        CHECK(integral * 2 * r / n == Approx(1).epsilon(2e-3));
        CHECK(filter_value(view, {float(r) * 1.01f, 0}) == 0);
        if (type != FilterType::gaussian) {
            // Closed forms: the distribution of sample_filter_1d has the density filter_value_1d, to the rounding of a
            // difference.
            for (double u = 0.0005; u < 0.999; u += 0.001) {
                const double a = sample_filter_1d(view, float(u)), b = sample_filter_1d(view, float(u + 0.0005));
                REQUIRE(filter_value_1d(view, float(0.5 * (a + b))) * (b - a) ==
                        Approx(0.0005).epsilon(a * b < 0 || std::fabs(a) > 0.95 * r ? 0.02 : 2e-3));
            }
            continue;
        }
        // The entry that a search finds, wherever the offset lies, on entries too.
        const auto searched = [&](float x) {
            const float* above = std::upper_bound(table, table + kFilterTableSize + 1, x);
            return above == table || above == table + kFilterTableSize + 1
                       ? 0.0f
                       : 1.0f / (float(kFilterTableSize) * (above[0] - above[-1]));
        };
        for (uint32_t i = 0; i <= kFilterTableSize; ++i)
            for (const float x : {table[i], std::nextafter(table[i], -9.0f), std::nextafter(table[i], 9.0f)})
                REQUIRE(filter_value_1d(view, x) == searched(x));
        for (uint32_t i = 0; i < 100000; ++i) {
            const float x = float(r) * (2.2f * random(43, i).x - 1.1f);
            REQUIRE(filter_value_1d(view, x) == searched(x));
        }
        CHECK(sample_filter_1d(view, 0.0f) == Approx(-r).margin(1e-3));
        CHECK(sample_filter_1d(view, 1.0f) == Approx(r).margin(1e-3));
    }
}

TEST_CASE("B16: film positions of a crop are those of the full film", "[sensor]") {
    Scene scene;
    scene.sensor = make_sensor(SensorType::perspective);
    scene.sensor.filter_radius = 0.5f;
    const Vec2f full = sample_film_position(view_of(scene), 12, 9, {0.25f, 0.75f});
    CHECK(full.x == Approx(12.25));
    CHECK(full.y == Approx(9.75));
    scene.sensor.crop_x = 10;
    scene.sensor.crop_y = 4;
    scene.sensor.crop_width = scene.sensor.crop_height = 5;
    const Vec2f crop = sample_film_position(view_of(scene), 2, 5, {0.25f, 0.75f});
    CHECK(crop.x == full.x);
    CHECK(crop.y == full.y);
}
