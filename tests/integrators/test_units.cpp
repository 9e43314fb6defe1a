// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Images do not depend on the units of emission and of length, nor on where a scene lies: what is multiplied by a power
// of two comes out multiplied by it to the last bit, whatever the strategy and the heuristic.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include "core/error.h"
#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

/// A closed white room with a lamp under its ceiling, a block and a glossy ball.
struct Room {
    double emission = 1, scale = 1, x = 0, y = 0, z = 0;
    double albedo = 0.8;
    int max_depth = 12;

    std::string placed(const std::string& local) const {
        return fmt::format(
            "<transform name='to_world'>{}<scale value='{}'/><translate x='{}' y='{}' z='{}'/></transform>", local,
            scale, x, y, z);
    }
    Scene load() const {
        const std::string white =
            fmt::format("<bsdf type='diffuse'><rgb name='reflectance' value='{0},{0},{0}'/></bsdf>", albedo);
        const std::string gloss =
            "<bsdf type='roughconductor'><string name='material' value='Ag'/><float name='alpha' value='0.3'/></bsdf>";
        const std::string light =
            fmt::format("<emitter type='area'><rgb name='radiance' value='{0},{1},{2}'/></emitter>", emission,
                        0.5 * emission, 2 * emission);
        const std::string body =
            fmt::format(
                "<sensor type='perspective'><float name='fov' value='60'/><float name='near_clip' value='{}'/>"
                "<float name='far_clip' value='{}'/>",
                0.0625 * scale, 1024 * scale) +
            fmt::format(
                "<transform name='to_world'><lookat origin='{},{},{}' target='{},{},{}' up='0,1,0'/></transform>", x, y,
                z + 0.875 * scale, x, y - 0.25 * scale, z) +
            film(16) + "</sensor>" + "<shape type='cube'><boolean name='flip_normals' value='true'/>" + placed("") +
            white + "</shape>" + "<shape type='cube'>" +
            placed("<scale value='0.25'/><translate x='-0.5' y='-0.75' z='-0.25'/>") + white + "</shape>" +
            "<shape type='sphere'>" + placed("<scale value='0.25'/><translate x='0.5' y='-0.5' z='-0.5'/>") + gloss +
            "</shape>" + "<shape type='rectangle'>" +
            placed("<scale value='0.125'/><rotate x='1' angle='90'/><translate y='0.9375'/>") + white + light +
            "</shape>";
        return scene_from_text(scene_xml(max_depth, body, "<integer name='rr_depth' value='2'/>"));
    }
};

/// All ways to find the light, and schedules that hold it in different places.
std::vector<Method> methods() {
    std::vector<Method> list = {{"-i light"}, {"hits"}, {"light"}};
    for (const char* variant : {"wavefront", "lvc", "streaming", "megakernel"})
        for (const MisHeuristic h : {MisHeuristic::balance, MisHeuristic::power}) list.push_back({"all", h, variant});
    return list;
}

std::string described(const Method& m) {
    return m.name + ", " + m.variant + (m.heuristic == MisHeuristic::power ? ", power" : "");
}

RenderSettings settings_of(const Scene& scene, const Method& m) {
    RenderSettings s = method_settings(scene, m, 7);
    s.accel = "cwbvh";  // our own traversal scales to the bit
    return s;
}

/// Values that are not `factor` times those of `expected`.
size_t differing(const FilmMoments& film, const FilmMoments& expected, double factor) {
    size_t n = 0;
    for (size_t i = 0; i < film.sum.size(); ++i)
        n +=
            film.sum[i] != factor * expected.sum[i] || film.sum_squares[i] != factor * factor * expected.sum_squares[i];
    return n;
}

void check_scaled(const Scene& scene, const Scene& scaled, double factor) {
    // Else the order in which threads add splats may show in the last bit of a double (docs/numerics.md).
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    for (const Method& m : methods()) {
        INFO(described(m));
        const RenderResult expected = render_scene(scene, settings_of(scene, m), 4);
        const RenderResult image = render_scene(scaled, settings_of(scaled, m), 4);
        CHECK(*std::max_element(expected.film.sum.begin(), expected.film.sum.end()) > 0);
        CHECK(differing(image.film, expected.film, factor) == 0);
        CHECK(expected.stats.invalid.total() == 0);
        CHECK(image.stats.invalid.total() == 0);
    }
}

}  // namespace

TEST_CASE("The unit of emission changes no decision: roulette, splats and weights scale to the bit", "[units]") {
    const Scene scene = Room{}.load();
    for (const int exponent : {-80, 80}) {
        INFO("emission 2^" << exponent);
        Room room;
        room.emission = std::ldexp(1.0, exponent);
        check_scaled(scene, room.load(), room.emission);
    }
}

TEST_CASE("B33: the unit of length changes no image, from 1e-9 to 1e9, by either heuristic", "[units]") {
    const Scene scene = Room{}.load();
    for (const int exponent : {-32, 32}) {
        INFO("length 2^" << exponent);
        Room room;
        room.scale = std::ldexp(1.0, exponent);
        const Scene scaled = room.load();
        CHECK(scaled.degenerate_triangles == 0);
        check_scaled(scene, scaled, 1.0);
    }
}

TEST_CASE("A white room is as bright as its closed form in any unit: radiance L / (1 - albedo) by light tracing",
          "[units]") {
    for (const double emission : {1e-12, 1e9}) {
        INFO("L = " << emission);
        const Scene scene = scene_from_text(scene_xml(
            -1, "<sensor type='perspective'><float name='fov' value='90'/>" +
                    lookat("origin='0,0,0' target='0,0,1' up='0,1,0'") + film(16) +
                    "</sensor><shape type='cube'><boolean name='flip_normals' value='true'/>" +
                    diffuse({0.8f, 0.8f, 0.8f}) +
                    fmt::format("<emitter type='area'><rgb name='radiance' value='{0},{0},{0}'/></emitter></shape>",
                                emission)));
        const float bright = float(emission / 0.2);
        for (const Method& m : {kLightTracer, kAll}) {
            INFO(described(m));
            check_image(scene, method_settings(scene, m, 11), constant_image(16, 16, {bright, bright, bright}));
        }
    }
}

TEST_CASE("B33: a room 0.5 wide and a million away is the room at the origin", "[units]") {
    Room near;
    near.scale = 0.25;
    near.emission = 3;
    Room far = near;
    far.x = 1e6 + 0.3, far.y = -2e6, far.z = 1e5 - 0.7;
    const Scene a = near.load(), b = far.load();
    CHECK(std::abs(b.origin[0] - far.x) < 1);
    CHECK(a.origin == std::array<double, 3>{});
    const Estimate path = render_path(a, 2048);
    for (const Method& m : {kLightTracer, kAll}) {
        INFO(described(m));
        check_agreement(b, method_settings(b, m, 3), 512, path, 0.05);
    }
}

TEST_CASE("Roulette with a cap near one keeps the variance of a furnace of albedo 0.99 finite", "[units]") {
    // 0.99² / 0.95 > 1: with the default cap the second moment has no bound.
    const Scene scene =
        scene_from_text(scene_xml(-1, "<sensor type='perspective'><float name='fov' value='90'/>" +
                                          lookat("origin='0,0,0' target='0,0,1' up='0,1,0'") + film(16) +
                                          "</sensor><shape type='sphere'><boolean name='flip_normals' value='true'/>"
                                          "<float name='radius' value='2'/>" +
                                          diffuse({0.99f, 0.99f, 0.99f}) + area_light({1, 1, 1}) + "</shape>"));
    const Image expected = constant_image(16, 16, splat(1.0f / (1.0f - 0.99f)));
    RenderSettings s = cpu_settings(scene, Estimator::naive, 5);
    apply_setting(s, "rr_cap", "0.999");
    check_expectation(scene, s, expected);
    apply_setting(s, "rr_cap", "1");
    CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring("rr_cap") && ContainsSubstring("max_depth"));
    CHECK_THROWS_AS(apply_setting(s, "rr_cap", "0"), Error);
    CHECK_THROWS_AS(apply_setting(s, "rr_cap", "1.5"), Error);
    CHECK_THROWS_AS(apply_setting(s, "rr_cap", "nan"), Error);
}
