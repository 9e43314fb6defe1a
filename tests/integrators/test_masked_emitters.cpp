// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 240
// seconds: 25
// Emitters behind a mask: every strategy finds the light that the emitter sends without it, as in Mitsuba.
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

const std::string kBlack = diffuse({0, 0, 0});

std::string masked(const std::string& opacity) { return "<bsdf type='mask'>" + opacity + kBlack + "</bsdf>"; }
std::string number(double opacity) { return "<float name='opacity' value='" + std::to_string(opacity) + "'/>"; }
const std::string kWaves =
    "<texture name='opacity' type='bitmap'><boolean name='raw' value='true'/><string name='filename' "
    "value='" AMBILUX_SOURCE_DIR "/scenes/assets/waves.png'/></texture>";

/// Of lamps in sight, where a hit counts 1/opacity: wrong meanings differ by the opacity itself.
constexpr double kSees = 0.1;

std::string sphere_lamp(const std::string& bsdf) {
    return "<shape type='sphere'><point name='center' x='0.3' y='-0.2' z='1.5'/><float name='radius' value='0.5'/>" +
           bsdf + area_light(kLight) + "</shape>";
}

/// Lamps of three shapes over a floor and a ball, with nothing behind them that light could pass to.
Scene lamps_over_floor(const std::string& bsdf) {
    const std::string end = bsdf + area_light({6, 9, 4}) + "</shape>";
    return scene_from_text(scene_xml(
        4,
        "<sensor type='perspective'><float name='fov' value='60'/>" +
            lookat("origin='0,-3,1.2' target='0,0,0.5' up='0,0,1'") + film(12) + "</sensor>" + kPlane +
            "<shape type='sphere'><point name='center' x='0.5' y='0.3' z='0.3'/><float name='radius' value='0.3'/>" +
            diffuse({0.6f, 0.5f, 0.7f}) + "</shape>" +
            "<shape type='rectangle'><transform name='to_world'><scale x='0.3' y='0.4'/><rotate x='1' "
            "angle='180'/><translate x='-0.6' z='1.6'/></transform>" +
            end +
            "<shape type='disk'><transform name='to_world'><scale value='0.2'/><rotate y='1' angle='200'/><translate "
            "x='0.7' z='1.7'/></transform>" +
            end));
}

std::vector<Method> all_methods() {
    std::vector<Method> methods(std::begin(kMethods), std::end(kMethods));
    for (const char* variant : {"lvc", "streaming", "megakernel"}) {
        methods.push_back({"all", MisHeuristic::balance, variant});
        methods.push_back({"all", MisHeuristic::power, variant});
    }
    return methods;
}

}  // namespace

TEST_CASE("A masked sphere lights a plane as it does without its mask, by every strategy", "[bidirectional]") {
    const Image expected = plane_image(kLight, sphere_irradiance);
    for (const double opacity : first_or_all<double>(1, {0.5, 0.05})) {
        const Scene scene = plane_under(sphere_lamp(masked(number(opacity))));
        uint64_t seed = 1;
        for (const EstimatorCase& e : kEstimators) {
            INFO("opacity " << opacity << ", path " << e.name);
            const bool few_hits = e.estimator == Estimator::naive && opacity < 0.1;
            if (!few_hits) check_expectation(scene, case_settings(scene, e, seed++), expected);
        }
        for (const Method& m : all_methods()) {
            INFO("opacity " << opacity << ", " << m.name << " " << m.variant << " heuristic " << int(m.heuristic));
            const bool few_hits = m.name == "hits" && opacity < 0.1;
            if (!few_hits) check_image(scene, method_settings(scene, m, seed++), expected);
        }
    }
}

TEST_CASE("Masked lamps in sight, of one opacity and of a texture, give the image of lamps without a mask",
          "[bidirectional]") {
    const Scene opaque = lamps_over_floor(kBlack);
    const Estimate truth = render_path(opaque, 4096);
    for (const std::string& opacity : first_or_all<std::string>(1, {kWaves, number(0.4)})) {
        const Scene scene = lamps_over_floor(masked(opacity));
        for (const EstimatorCase& e : kEstimators) {
            if (e.estimator == Estimator::naive) continue;
            INFO(opacity << ", path " << e.name);
            const RenderResult r = render_scene(scene, case_settings(scene, e, 5), 4096);
            check_agreement(to_estimate(r.film), truth, kSees);
        }
        for (const Method& m : all_methods()) {
            if (m.name != "all" && m.name != "-i light") continue;
            INFO(opacity << ", " << m.name << " " << m.variant << " heuristic " << int(m.heuristic));
            check_agreement(scene, method_settings(scene, m, 6), 2048, truth, kSees);
        }
    }
}

TEST_CASE("A lamp of opacity 0 sends no light by any strategy, and the scene says so", "[bidirectional]") {
    const Scene scene = plane_under(sphere_lamp(masked(number(0))));
    REQUIRE(scene.warnings.size() == 1);
    CHECK(scene.warnings[0].find("opacity 0") != std::string::npos);
    for (const EstimatorCase& e : kEstimators) check_black(render_scene(scene, case_settings(scene, e), 8));
    for (const Method& m : all_methods()) check_black(render_scene(scene, method_settings(scene, m, 1), 8));
}
