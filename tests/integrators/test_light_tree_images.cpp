// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// light_picking=tree: closed forms, the image of lights picked by power, less variance in a row of rooms, and where it
// is refused.
#include <fmt/format.h>

#include "integrators/offers.h"
#include "render/replay/replay.h"
#include "scene/light_tree.h"
#include "tests/support/closed_forms.h"
#include "tests/support/many_lights.h"

using namespace ambilux;

namespace {

struct Method {
    const char *integrator, *variant;
    Estimator estimator = Estimator::mis;
};
constexpr Method kMethods[] = {{"path", "wavefront"},
                               {"path", "wavefront", Estimator::nee},
                               {"path", "ris"},
                               {"bdpt", "wavefront"},
                               {"bdpt", "lvc"}};

RenderSettings tree_settings(const Scene& scene, const Method& m, uint64_t seed = 1) {
    RenderSettings s = cpu_settings(scene, m.estimator, seed);
    s.integrator = m.integrator;
    s.variant = m.variant;
    s.light_picking = LightPicks::tree;
    return s;
}

bool has_tree(const RenderStats& stats) {
    return stats.settings.light_picking == LightPicks::tree &&
           std::find(stats.features.begin(), stats.features.end(), "sampling") != stats.features.end();
}

/// A row of rooms with a lamp in each, seen from within one of them.
std::string rooms(int count) {
    const auto shape = [](const std::string& type, const std::string& transform, const std::string& rest) {
        return "<shape type='" + type + "'><transform name='to_world'>" + transform + "</transform>" + rest +
               "</shape>";
    };
    const std::string grey = "<bsdf type='twosided'>" + diffuse({0.6f, 0.6f, 0.6f}) + "</bsdf>";
    std::string s =
        "<sensor type='perspective'><float name='fov' value='70'/><transform name='to_world'><lookat "
        "origin='0.3,1,0.8' target='2,0.8,-0.6' up='0,1,0'/></transform>" +
        square_film(16) + "</sensor>";
    s += shape("cube", fmt::format("<scale x='{}' y='1' z='1'/><translate x='{}' y='1'/>", count, count),
               "<boolean name='flip_normals' value='true'/>" + diffuse({0.6f, 0.6f, 0.6f}));
    for (int i = 0; i < count; ++i) {
        if (i > 0)
            s += shape("rectangle", fmt::format("<rotate y='1' angle='90'/><translate x='{}' y='1'/>", 2 * i), grey);
        s += shape("rectangle",
                   fmt::format("<scale value='0.05'/><rotate x='1' angle='90'/><translate x='{}' y='1.9'/>", 2 * i + 1),
                   area_light({9, 9, 9}));
        s += shape("sphere", fmt::format("<scale value='0.04'/><translate x='{}' y='1.2' z='-0.5'/>", 2 * i + 0.5),
                   area_light({5, 7, 9}));
    }
    return scene_xml(3, s);
}

/// A floor under lamps of all kinds that a path tracer finds.
std::string many_kinds() {
    std::string s =
        "<sensor type='perspective'><float name='fov' value='60'/><transform name='to_world'><lookat "
        "origin='0,1.2,2.5' target='0,0,0' up='0,1,0'/></transform>" +
        square_film(24) +
        "</sensor><shape type='rectangle'><transform name='to_world'><scale value='3'/><rotate x='1' "
        "angle='-90'/></transform>" +
        diffuse({0.5f, 0.6f, 0.7f}) + "</shape>";
    for (uint32_t i = 0; i < 42; ++i) {
        const Vec3f at = {float(i % 7) * 0.4f - 1.2f, 0.4f + 0.1f * float(i % 5), float(i / 7) * 0.4f - 1.2f};
        s += test::lamp_of_kind(i * 5 % 7, at, at + Vec3f{0.3f, -1.0f, 0.1f * float(i % 3)}, 0.05, 1 + i % 4);
    }
    return scene_xml(3, s);
}

/// Variance of one sample over the squared mean of the image, mean over pixels and channels.
double relative_variance(const FilmMoments& m) {
    const double n = double(m.samples);
    double mean = 0, variance = 0;
    for (size_t i = 0; i < m.sum.size(); ++i) {
        mean += m.sum[i] / n;
        variance += m.sum_squares[i] / n - m.sum[i] / n * m.sum[i] / n;
    }
    return variance * double(m.sum.size()) / (mean * mean);
}

}  // namespace

TEST_CASE("A furnace whose triangles are picked by a tree has its closed form", "[path][bidirectional]") {
    constexpr Rgb kAlbedo = {0.8f, 0.5f, 0.2f}, kLight = {3, 5, 2};
    const std::string camera =
        "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>"
        "<transform name='to_world'><lookat origin='0.2,-0.1,0.3' target='-0.4,0.3,-0.7' up='0,1,0'/></transform>" +
        square_film(8) + "</sensor>";
    const Scene scene =
        scene_from_text(scene_xml(3, camera + "<shape type='cube'><boolean name='flip_normals' value='true'/>" +
                                         diffuse(kAlbedo) + area_light(kLight) + "</shape>"));
    Rgb expected{};
    for (int c = 0; c < 3; ++c)
        for (int k = 0; k < 3; ++k) expected[c] += kLight[c] * float(std::pow(double(kAlbedo[c]), k));
    for (const Method& m : {kMethods[0], kMethods[3]}) {
        INFO(m.integrator << " " << m.variant);
        check_expectation(scene, tree_settings(scene, m), constant_image(8, 8, expected));
    }
}

TEST_CASE("A plane under bulbs and balls that a tree picks has its closed form", "[path][bidirectional]") {
    constexpr uint32_t kSize = 16;
    constexpr Rgb kAlbedo = {0.5f, 0.7f, 0.3f};
    std::string xml =
        "<sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,0.1' target='0,0,0' "
        "up='0,1,0'/></transform>" +
        square_film(kSize) +
        "</sensor><shape type='rectangle'><transform name='to_world'><scale value='1.5'/>"
        "</transform>" +
        diffuse(kAlbedo) + "</shape>";
    struct Bulb {
        double x, y, z, strength;  // W/sr
    };
    std::vector<Bulb> bulbs;
    for (int i = 0; i < 40; ++i) {
        const Bulb b = {-1.4 + 2.8 * (i * 7 % 40) / 39.0, 1.3 * std::sin(i * 1.7), 0.3 + 0.02 * i, 0.1 + i * 13 % 11};
        const std::string at = fmt::format("x='{}' y='{}' z='{}'", b.x, b.y, b.z);
        constexpr double kRadius = 0.02;
        if (i % 2)
            xml += "<emitter type='point'><point name='position' " + at + "/>" +
                   fmt::format("<rgb name='intensity' value='{}'/></emitter>", b.strength);
        else
            xml += "<shape type='sphere'><point name='center' " + at +
                   fmt::format(
                       "/><float name='radius' value='{}'/>"
                       "<emitter type='area'><rgb name='radiance' value='{}'/></emitter></shape>",
                       kRadius, b.strength / (M_PI * kRadius * kRadius));
        bulbs.push_back(b);
    }
    const Scene scene = scene_from_text(scene_xml(2, xml));
    const Image expected = image_of(kSize, kSize, kAlbedo, [&](double film_x, double film_y) {
        const double x = -1 + 2 * film_x / kSize, y = 1 - 2 * film_y / kSize;
        double sum = 0;
        for (const Bulb& b : bulbs) {
            const double d2 = (x - b.x) * (x - b.x) + (y - b.y) * (y - b.y) + b.z * b.z;
            sum += b.strength * b.z / (d2 * std::sqrt(d2)) / M_PI;
        }
        return sum;
    });
    for (const Method& m : kMethods) {
        if (m.estimator == Estimator::nee) continue;
        INFO(m.integrator << " " << m.variant);
        const RenderSettings s = tree_settings(scene, m);
        CHECK(has_tree(make_renderer(scene, s)->stats()));
        check_expectation(scene, s, expected);
    }
}

TEST_CASE("Lights picked by a tree give the image of those picked by power", "[path][bidirectional]") {
    std::vector<Scene> scenes;
    scenes.push_back(project_scene("lights", 32, 24));
    scenes.push_back(scene_from_text(many_kinds()));
    for (const Scene& scene : scenes) {
        const uint32_t spp = 192;
        const Estimate by_power =
            to_estimate(render_scene(scene, cpu_settings(scene, Estimator::mis, 11), 2 * spp).film);
        for (const Method& m : kMethods) {
            const RenderResult r = render_scene(scene, tree_settings(scene, m, 12), spp);
            const ZTestResult z = z_test(to_estimate(r.film), by_power);
            INFO(scene.path << ", " << m.integrator << " " << m.variant << ": " << z.report());
            CHECK(z.pass);
            CHECK(has_tree(r.stats));
            CHECK(r.stats.invalid.total() == 0);
        }
    }
}

TEST_CASE("In a row of rooms a tree has less variance than power", "[path][bidirectional]") {
    const Scene scene = scene_from_text(rooms(16));
    for (const Method& m : kMethods) {
        RenderSettings s = tree_settings(scene, m);
        const FilmMoments by_tree = render_scene(scene, s, 128).film;
        s.light_picking = LightPicks::table;
        s.seed = 2;
        const FilmMoments by_power = render_scene(scene, s, 128).film;
        const double tree = relative_variance(by_tree), power = relative_variance(by_power);
        INFO(m.integrator << " " << m.variant << ", variance of a sample: " << power << " by power, " << tree);
        CHECK(tree < (std::string(m.variant) == "ris" ? 0.5 : 0.25) * power);
        const ZTestResult z = z_test(to_estimate(by_tree), to_estimate(by_power));
        INFO(z.report());
        CHECK(z.pass);
    }
}

TEST_CASE("Where there is one lamp to pick, kernels know of no tree") {
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = tree_settings(scene, kMethods[0]);
    const RenderResult r = render_scene(scene, s, 4);
    CHECK_FALSE(has_tree(r.stats));
    s.light_picking = LightPicks::table;
    CHECK(render_scene(scene, s, 4).film.sum == r.film.sum);
}

TEST_CASE("Predicted memory holds the tree") {
    const Scene scene = project_scene("lights", 16, 16);
    RenderSettings s = tree_settings(scene, kMethods[0]);
    const RenderStats tree = render_scene(scene, s, 1).stats;
    s.light_picking = LightPicks::table;
    s.specialise = false;
    const RenderStats table = render_scene(scene, s, 1).stats;
    CHECK(tree.memory_bytes == tree.memory_bytes_predicted);
    CHECK(tree.memory_bytes >= table.memory_bytes + light_tree_bytes(scene));
}

TEST_CASE("light_picking=tree is refused by name where there is none") {
    const Scene scene = project_scene("lights", 16, 16);
    const auto refused = [&](const Method& m, const SettingTexts& texts, const char* why) {
        RenderSettings s = tree_settings(scene, m);
        for (const auto& [key, value] : texts) apply_setting(s, key, value);
        INFO(m.integrator << " " << m.variant);
        CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring(why));
    };
    for (const Method& m : {Method{"bdpt", "streaming"},
                            {"bdpt", "megakernel"},
                            {"bdpt", "learned"},
                            {"light", "wavefront"},
                            {"vpl", "wavefront"}})
        refused(m, {}, "light_picking=tree: its kernels pick emitters by the table alone");
    refused({"path", "wavefront"}, {{"precision", "double"}}, "light_picking=tree: precision=double");
    refused({"path", "wavefront"}, {{"fuse", "none"}}, "fuse=none: there are no such kernels");
    refused({"bdpt", "wavefront"}, {{"bdpt.auto", "true"}}, "light_picking=tree: its pilot");
    CHECK_THROWS_WITH(check_replay(tree_settings(scene, kMethods[0])), ContainsSubstring("light_picking=tree"));
    RenderSettings s;
    CHECK_THROWS_WITH(apply_setting(s, "light_picking", "best"), ContainsSubstring("table"));
}
