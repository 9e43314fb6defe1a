// libs: ambilux_formats ambilux_accel
// timeout: 120
// Sky and sun. Numbers marked "Mitsuba" were read from Mitsuba 3.9.1.
#include "formats/document/sky.h"

#include <cmath>

#include "core/math.h"
#include "tests/support/mitsuba_text.h"
#include "transport/emitter/envmap.h"

using namespace ambilux;
using namespace ambilux::test;
using namespace ambilux::document;

namespace {

constexpr double kDegree = M_PI / 180;

void check_ratio(Rgb a, Rgb b, double tolerance) {
    for (int i = 0; i < 3; ++i) CHECK(a[i] == Approx(b[i]).epsilon(tolerance));
}

Scene sky_scene(const std::string& type, const std::string& xml, const std::string& version = "3.0.0") {
    return load("<shape type='rectangle'/><emitter type='" + type + "'>" + xml + "</emitter>", {}, version);
}

Rgb seen(const Scene& s, Vec3f direction) {
    return envmap_radiance(s.view(), s.emitters[s.environment], normalize(direction));
}

/// Light on a surface with this normal, by a sum over directions in fine steps.
Rgb irradiance(const Scene& s, Vec3f normal) {
    const SceneView view = s.view();
    const Emitter& e = s.emitters[s.environment];
    constexpr int kRows = 4096, kColumns = 8192;
    double sum[3] = {};
    for (int y = 0; y < kRows; ++y) {
        float sine;
        const double v = (y + 0.5) / kRows;
        for (int x = 0; x < kColumns; ++x) {
            const Vec2f uv = {float((x + 0.5) / kColumns), float(v)};
            const Vec3f d = e.to_world.vector(envmap_direction(uv, sine));
            const double weight = std::max(0.0f, dot(d, normal)) * sine * (M_PI / kRows) * (2 * M_PI / kColumns);
            if (weight <= 0) continue;
            const Rgb c = envmap_lookup(view, e, uv);
            for (int k = 0; k < 3; ++k) sum[k] += weight * c[k];
        }
    }
    return {float(sum[0]), float(sum[1]), float(sum[2])};
}

}  // namespace

TEST_CASE("The sky's radiance agrees with Mitsuba for turbidity, albedo and elevation between the tables' nodes") {
    check_ratio(Sky(3.0, splat(0.3f), 1.0).radiance(0.9210609940028851, 0.4374494610995678),
                {0.04929933f, 0.07225984f, 0.12475897f}, 1e-5);
    check_ratio(Sky(5.5, splat(0.1f), 0.2).radiance(0.3623577544766736, 2.291380255923399),
                {0.04341044f, 0.06121529f, 0.07576096f}, 1e-5);
    check_ratio(Sky(2.2, splat(0.8f), 0.6).radiance(0.020794827803092428, 0.5866922339332021),
                {0.28858805f, 0.35760731f, 0.3621498f}, 1e-5);
}

TEST_CASE("The sun stands where it should") {
    // 21 June 2010 at noon of local solar time on the northern tropic: overhead. Equinox on the equator at 6: in the
    // east, at the horizon.
    SunTime t;
    t.year = 2010, t.month = 6, t.day = 21, t.hour = 12, t.minute = 2;
    t.latitude = 23.44, t.longitude = 0, t.timezone = 0;
    CHECK(sun_position(t).zenith / kDegree < 0.3);
    t.month = 3, t.day = 20, t.hour = 6, t.minute = 7, t.latitude = 0;
    CHECK(sun_position(t).zenith / kDegree == Approx(90).margin(0.3));
    CHECK(sun_position(t).azimuth / kDegree == Approx(90).margin(0.3));
}

TEST_CASE("sunsky: the map shows sky and sun where the file puts them, and has the sun's irradiance") {
    const Vec3f sun = normalize(Vec3f{0.3f, -0.5f, 0.6f});
    const double elevation = std::asin(double(sun.z));
    const std::string direction = "<vector name='sun_direction' x='0.3' y='-0.5' z='0.6'/>";
    const Scene both = sky_scene("sunsky", direction), sky = sky_scene("sunsky", direction +
                                                                                     "<float name='sun_scale' "
                                                                                     "value='0'/>");
    CHECK(both.warnings.empty());
    const Sky model(3, splat(0.3f), elevation);
    for (const Vec3f& to : {Vec3f{-0.2f, 0.1f, 0.9f}, {0.8f, 0.5f, 0.3f}, {-0.5f, -0.8f, 0.5f}}) {
        const Vec3f d = normalize(to);
        check_ratio(seen(sky, d), model.radiance(double(d.z), std::acos(double(dot(d, sun)))), 5e-3);
    }
    CHECK(is_zero(seen(both, {0.3f, 0.2f, -0.6f})));
    CHECK(seen(both, sun).y > 1000);
    check_ratio(irradiance(both, sun) - irradiance(sky, sun), sun_irradiance(3, elevation), 2e-3);
}

TEST_CASE("sky, sun and sunsky of the older format: +y is up, date and place, scale, stretch") {
    const Scene sky = sky_scene("sky", "<float name='scale' value='2'/>", "0.6.0");
    const SunAngles at = sun_position({});
    const Vec3f sun = {float(std::sin(at.azimuth) * std::sin(at.zenith)), float(std::cos(at.zenith)),
                       float(-std::cos(at.azimuth) * std::sin(at.zenith))};
    const Sky model(3, splat(0.2f), M_PI / 2 - at.zenith);
    const Vec3f d = normalize(Vec3f{0.3f, 0.8f, 0.4f});
    check_ratio(seen(sky, d), model.radiance(double(d.y), std::acos(double(dot(d, sun)))) * 2, 5e-3);
    CHECK(is_zero(seen(sky, {0.3f, -0.2f, 0.4f})));
    const Scene stretched = sky_scene("sky", "<float name='stretch' value='1.5'/>", "0.6.0");
    CHECK(!is_zero(seen(stretched, {0.3f, -0.2f, 0.4f})));
    const Scene alone = sky_scene("sun", "<float name='sunRadiusScale' value='4'/>", "0.6.0");
    check_ratio(irradiance(alone, sun), sun_irradiance(3, M_PI / 2 - at.zenith), 2e-3);
    REQUIRE(alone.notes.size() == 1);
    CHECK(contains(alone.notes[0], "the sun is that of Hosek and Wilkie 2013"));
}

TEST_CASE("sky: what cannot be is refused with its line") {
    const auto refused = [](const std::string& xml) {
        return error_of("<emitter type='sunsky'>\n" + xml + "</emitter>");
    };
    CHECK(contains(refused("<float name='turbidity' value='11'/>"), ":3: turbidity must lie between 1 and 10"));
    CHECK(contains(refused("<float name='hour' value='2'/>"), "the sun is below the horizon"));
    CHECK(contains(refused("<boolean name='complex_sun' value='true'/>"), ":3: complex_sun is not supported"));
    CHECK(contains(refused("<integer name='year' value='999999'/>"), ":3: '999999' is no date"));
    LoadOptions small;
    small.limits.pixels = 1 << 20;
    CHECK(contains(error_of("<emitter type='sky'/>", small), "no error"));
    CHECK(contains(error_of("\n<emitter type='sunsky'/>", small),
                   "a sky is an image of 2048x2048 pixels, which is larger than --limits pixels=1048576"));
    CHECK(contains(error_of("<emitter type='sky'/><emitter type='constant'/>"), "only one constant, envmap or sky"));
}
