// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 900
// Renders of published scenes against the images that were published with them, made by other renderers.
#include "film/ztest.h"
#include "formats/load.h"
#include "tests/support/published_image.h"

using namespace ambilux;

namespace {

const std::string kTests = "mitsuba-tests/tests/scenes/";

/// The rule of Mitsuba's own render tests. It takes the variance from the reference, so the sampling has to be
/// Mitsuba's as well: emitters are chosen uniformly and weighted by the power heuristic. With others the image is as
/// right, but its variance is another: test_spot has 2.7 times as much under the balance heuristic.
void require_mitsuba_test(const std::string& folder, const std::string& name, const std::string& integrator) {
    const auto file = published_file(kTests + folder + "/" + name + "_" + integrator + ".xml");
    if (!file) return;
    const Image mean = read_exr(*published_file(kTests + folder + "/refs/" + name + "_ref_rgb.exr"));
    const Image variance = read_exr(*published_file(kTests + folder + "/refs/" + name + "_ref_rgb_var.exr"));
    LoadOptions options;
    options.light_picking = LightPicking::uniform;
    const Scene scene = load_mitsuba(*file, options);
    CHECK(scene.warnings.empty());

    RenderSettings settings = cpu_settings(scene, Estimator::mis);
    settings.heuristic = MisHeuristic::power;
    const uint32_t spp = 2000000 / (mean.width * mean.height);  // as Mitsuba's test does
    const RenderResult result = render_scene(scene, settings, spp);
    const MitsubaZTest z = mitsuba_z_test(mean_image(result.film), spp, mean, variance);
    INFO(z.passed_fraction << " pass, worst z " << z.worst_z << " at (" << z.worst_x << ", " << z.worst_y
                           << "), channel " << z.worst_channel);
    CHECK(result.stats.invalid.total() == 0);
    CHECK(z.pass);
}

}  // namespace

TEST_CASE("Mitsuba render tests: spheres of many BSDFs under an area light") {
    require_mitsuba_test("bsdf_spheres", "test_arealight", "path");
}
// Here Mitsuba's shadow rays take a mask for opaque, and at depth 2 nothing makes up for it: its diffuse spheres are up
// to 3 % darker just above the leaves.
TEST_CASE("Mitsuba render tests: spheres of many BSDFs under a constant environment") {
    require_mitsuba_test("bsdf_spheres", "test_constant", "path");
}
TEST_CASE("Mitsuba render tests: spheres of many BSDFs and a point light") {
    require_mitsuba_test("bsdf_spheres", "test_pointlight", "path");
}
TEST_CASE("Mitsuba render tests: directional light") {
    require_mitsuba_test("floating_sphere", "test_directional", "direct");
}
TEST_CASE("Mitsuba render tests: instances") { require_mitsuba_test("instancing", "test_instancing", "path"); }
TEST_CASE("Mitsuba render tests: orthographic sensor") {
    require_mitsuba_test("orthographic_sensor", "test_orthographic", "path");
}
TEST_CASE("Mitsuba render tests: spot light that projects a texture") {
    require_mitsuba_test("spot_light", "test_spot", "direct");
}
TEST_CASE("Mitsuba render tests: texture filters and wrap modes") {
    require_mitsuba_test("texture_interp", "test_texture_interp", "direct");
}

TEST_CASE("Mitsuba render tests: colours at the vertices of a mesh") {
    require_mitsuba_test("mesh_attributes", "test_mesh_attributes_3_vertex", "direct");
}
// Its sdfgrid is triangles here.
TEST_CASE("Mitsuba render tests: all kinds of shapes") {
    require_mitsuba_test("various_shapes", "test_various_shapes", "path");
}

// Large blocks, few samples; test_published_references_long.cpp has blocks of 16 pixels. The published veach-mis shows
// direct light only.
TEST_CASE("cornell-box agrees with its published image") { require_published_image("cornell-box", 65, 8, 64); }
TEST_CASE("veach-mis agrees with its published image") { require_published_image("veach-mis", 2, 8, 64); }
