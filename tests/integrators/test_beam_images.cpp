// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Images lit by collimated and directionalarea emitters: closed forms, agreement of all methods that begin at the
// emitter, and what the others say.
#include "integrators/reachability.h"
#include "tests/support/beam_scene.h"
#include "tests/support/bidirectional_images.h"

using namespace ambilux;

namespace {

const Method kFromLights[] = {{"all"},
                              {"all", MisHeuristic::power},
                              {"all", MisHeuristic::balance, "megakernel"},
                              {"all", MisHeuristic::balance, "lvc"},
                              {"all", MisHeuristic::balance, "streaming"},
                              {"-i light"},
                              {"light"}};

void check_methods(const Scene& scene, const Image& expected, const std::vector<Method>& more = {}) {
    std::vector<Method> methods(std::begin(kFromLights), std::end(kFromLights));
    methods.insert(methods.end(), more.begin(), more.end());
    uint64_t seed = 1;
    for (const Method& m : methods) {
        INFO(m.name << ' ' << m.variant);
        check_image(scene, method_settings(scene, m, seed++), expected);
    }
}

/// Methods that begin at the camera find nothing, at no cost of shadow rays, and say so.
void check_others(const Scene& scene) {
    for (const EstimatorCase& e : kEstimators) {
        INFO(e.name);
        const RenderSettings s = case_settings(scene, e);
        const RenderResult r = render_scene(scene, s, 16);
        check_black(r);
        CHECK(r.stats.rays_occlude == 0);
        CHECK(missing_light(scene.features, s).find("such as Lb D E") != std::string::npos);
    }
    const RenderSettings s = method_settings(scene, {"hits+next_event"}, 1);
    check_black(render_scene(scene, s, 16));
    CHECK(missing_light(scene.features, s).find("such as Lb D E") != std::string::npos);
    CHECK(missing_light(scene.features, method_settings(scene, {"all"}, 1)).empty());
}

}  // namespace

TEST_CASE("collimated: a wall sees the spot on the floor, all of whose light comes from one point") {
    // The beam meets the floor at the origin; the wall is x = 1.
    const Scene scene = scene_from_text(
        scene_xml(3, orthographic(0.5, "-3,0,1", "1,0,1", 16) +
                         "<shape type='rectangle'><transform name='to_world'><scale value='3'/></transform>" +
                         diffuse(splat(0.5f)) +
                         "</shape><shape type='rectangle'><transform name='to_world'><scale value='2'/><rotate y='1' "
                         "angle='-90'/><translate x='1'/></transform>" +
                         diffuse(splat(0.8f)) + "</shape>" + collimated("0,0,3", "0,0,0", {3, 2, 1})));
    const Image expected = image_of(16, 16, {3, 2, 1}, [](double x, double y) {
        const double h = 0.5 * (1 - x / 8), z = 1 + 0.5 * (1 - y / 8), d2 = 1 + h * h + z * z;
        return 0.5 / M_PI * z / (d2 * d2) * 0.8 / M_PI;
    });
    check_methods(scene, expected, {{"connections"}});
    check_others(scene);
}

TEST_CASE("directionalarea: of radiosity E, irradiance E inside of its shadow and nothing outside") {
    // Seen at 45 degrees: the floor looks shorter along x by a root of two, by which the emitter is longer.
    for (const char* shape : {"rectangle", "cube"}) {
        INFO(shape);
        const bool flat = shape == std::string("rectangle");
        const Scene scene = scene_from_text(
            scene_xml(2, orthographic(0.8, "4,0,4", "0,0,0", 16) +
                             "<shape type='rectangle'><transform name='to_world'><scale value='3'/></transform>" +
                             diffuse(splat(0.5f)) + "</shape><shape type='" + shape +
                             "'><transform name='to_world'><scale x='0.565685425' y='0.4' z='0.1'/><rotate x='1' "
                             "angle='180'/><translate z='3'/></transform>" +
                             diffuse({0, 0, 0}) + directional_area({2, 3, 4}) + "</shape>"));
        const Image expected = image_of(16, 16, {2, 3, 4}, [](double x, double y) {
            return std::max(std::fabs(x - 8), std::fabs(y - 8)) < 4 ? 0.5 / M_PI : 0.0;
        });
        if (flat) {
            check_methods(scene, expected);
            check_others(scene);
            check_black(render_scene(scene, method_settings(scene, {"connections"}, 1), 16));
        } else {
            check_image(scene, method_settings(scene, {"all"}, 1), expected);
        }
    }
}

TEST_CASE("beams in a room beside a lamp: light tracing and all strategies agree") {
    const Scene scene = scene_from_text(beam_room(16, 5, true));
    ZTestOptions options;
    options.block = 8;
    const Estimate light = render_batches(scene, method_settings(scene, {"-i light"}, 11), 1u << 11);
    uint64_t seed = 20;
    for (const Method& m : {Method{"all"}, Method{"all", MisHeuristic::power, "lvc"}}) {
        INFO(m.name << ' ' << m.variant);
        check_agreement(scene, method_settings(scene, m, seed++), 1u << 10, light, 0.05, options);
    }
}

TEST_CASE("the pilot leaves out what cannot find beams") {
    const Scene scene = scene_from_text(beam_room(24, 5, true));
    const std::string lost = unreachable_path(scene.features, kHitStrategies | kNextEventStrategies, kAllStrategies, 5);
    CHECK(lost == "Lb D E");
}
