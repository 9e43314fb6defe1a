// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Images lit by hidden areas: closed forms, agreement of all methods, and that no ray meets them.
#include "integrators/reachability.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/hidden_light_scene.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

const std::vector<Method> kFinding = methods_and("next_event");

void check_methods(const Scene& scene, const Image& expected) {
    check_all_estimators(scene, expected, false);
    uint64_t seed = 1;
    for (const Method& m : kFinding) {
        INFO(m.name << ' ' << m.variant);
        check_image(scene, method_settings(scene, m, seed++), expected);
    }
    check_black(render_scene(scene, method_settings(scene, {"hits"}, 1), 16));
}

const std::string kHidden = hidden_light(rgb("radiance", kLight));

}  // namespace

TEST_CASE("a hidden sphere gives the irradiance of an area emitter, and the camera sees through it") {
    // The camera is outside of it, at height 0.1, and looks down; the light of the upper half goes away.
    const Scene scene = plane_under(
        "<shape type='sphere'><point name='center' x='0.3' y='-0.2' z='1.5'/><float name='radius' value='0.5'/>" +
        kHidden + "</shape>");
    check_methods(scene, plane_image(kLight, sphere_irradiance));
}

TEST_CASE("a hidden rectangle shines to one side, between camera and plane too") {
    const auto rectangle = [](const char* turn) {
        return std::string("<shape type='rectangle'><transform name='to_world'><scale x='0.5' y='0.3'/>") + turn +
               "<translate x='0.1' y='0.2' z='0.8'/></transform>" + kHidden + "</shape>";
    };
    const std::string camera =
        "<sensor type='orthographic'>" + lookat("origin='0,0,2' target='0,0,0' up='0,1,0'") + film(kSize) + "</sensor>";
    check_methods(
        plane_under(rectangle("<rotate x='1' angle='180'/>"), camera),
        plane_image(kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.6, -0.1, 0.5, 0.8); }));
    const Scene up = plane_under(rectangle(""), camera);
    check_black(render_scene(up, cpu_settings(up, Estimator::mis), 16));
    for (const Method& m : kFinding) check_black(render_scene(up, method_settings(up, m, 1), 16));
}

TEST_CASE("it casts no shadow of another light") {
    const std::string hidden =
        "<shape type='sphere'><point name='center' x='0.3' y='-0.2' z='0.5'/><float "
        "name='radius' value='0.2'/>" +
        hidden_light(rgb("radiance", {0, 0, 0})) + "</shape>";
    check_methods(plane_under(hidden + "<emitter type='point'><point name='position' x='0' y='0' z='1'/>" +
                              rgb("intensity", kLight) + "</emitter>"),
                  plane_image(kLight, [](double x, double y) {
                      const double d2 = x * x + y * y + 1;
                      return 1 / (d2 * std::sqrt(d2));
                  }));
}

TEST_CASE("hidden lights in a room: path tracing, light tracing and all strategies agree") {
    for (const char lamp : first_or_all<char>(1, {true, false})) {
        const Scene scene = scene_from_text(hidden_room(16, 4, lamp));
        INFO(lamp);
        agree(scene, {{"all"}, {"all", MisHeuristic::power}, {"-i light"}, {"connections+light"}}, 1u << 12, 1u << 10,
              0.05);
        CHECK(missing_light(scene.features, method_settings(scene, {"all"}, 1)).empty());
    }
}

TEST_CASE("what finds no hidden light says so") {
    const Scene scene = scene_from_text(hidden_room(8, 4, false));
    CHECK(missing_light(scene.features, method_settings(scene, {"hits"}, 1)).find("hiddenarea") != std::string::npos);
    CHECK_THROWS_WITH(scene_from_text(scene_xml(2, "<sensor type='perspective'>" + square_film(4) +
                                                       "</sensor><shape type='sphere'><emitter "
                                                       "type='hiddenarea'/></shape>")),
                      ContainsSubstring("needs bsdf 'null'"));
}
