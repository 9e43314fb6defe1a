// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// seconds: 41
// Where other bidirectional renderers broke (B1-B34): shading normals, refraction, lights, specular chains, coincident
// vertices, scale, opacity. What concerns furnaces, cameras and films is in test_bidirectional_images.cpp.
#include <array>

#include "film/exr_io.h"
#include "formats/load.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

std::string number(double v) {
    std::ostringstream s;
    s << v;
    return s.str();
}

/// Camera of 16 x 16 pixels.
std::string camera(const std::string& origin, const std::string& target, double fov, uint32_t size = 16) {
    return "<sensor type='perspective'><float name='fov' value='" + number(fov) +
           "'/><float name='near_clip' value='1e-4'/>" +
           lookat("origin='" + origin + "' target='" + target + "' up='0,0.3,1'") + film(size) + "</sensor>";
}

/// Compares the families of strategies that can sample paths without deltas, each by itself, with the path tracer, up
/// to every length. Emitters are hidden.
void agree_length_by_length(Scene scene, int longest, uint32_t spp, double sees) {
    scene.integrator.hide_emitters = true;
    scene.integrator.max_depth = 2;
    const Estimate direct = render_batches(scene, cpu_settings(scene, Estimator::mis, 2002), 4 * spp);
    for (int depth = 2; depth <= longest; ++depth) {
        Scene s = scene;
        s.integrator.max_depth = depth;
        const Estimate path = render_path(s, 4 * spp, uint64_t(1000 + depth));
        for (const char* name : {"light", "next_event", "connections", "all"}) {
            // Connections have three segments at least: the path tracer's two are added.
            const bool add_direct = std::string(name) == "connections";
            if (add_direct && depth == 2) continue;
            INFO("max_depth " << depth << ", " << name);
            const Estimate image = render_batches(s, method_settings(s, {name}, uint64_t(depth)), spp);
            check_agreement(add_direct ? sum(image, direct) : image, path, sees);
        }
    }
}

/// 26 vertices of a cube cut into 2 x 2 squares per side, pushed onto the unit sphere, with radial normals; `shared`
/// vertices or each corner its own.
std::string round_cube(bool shared) {
    std::ostringstream obj;
    std::vector<std::array<int, 3>> ids;
    int made = 0;
    const auto vertex = [&](std::array<int, 3> p) {
        if (shared)
            for (size_t i = 0; i < ids.size(); ++i)
                if (ids[i] == p) return int(i) + 1;
        ids.push_back(p);
        const double l = std::sqrt(double(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
        obj << "v " << p[0] / l << " " << p[1] / l << " " << p[2] / l << "\nvn " << p[0] / l << " " << p[1] / l << " "
            << p[2] / l << "\n";
        return ++made;
    };
    std::ostringstream faces;
    for (int axis = 0; axis < 3; ++axis)
        for (int side : {-1, 1})
            for (int a : {-1, 0})
                for (int b : {-1, 0}) {
                    int corner[4];
                    const int da[4] = {0, 1, 1, 0}, db[4] = {0, 0, 1, 1};
                    for (int k = 0; k < 4; ++k) {
                        std::array<int, 3> p{};
                        p[size_t(axis)] = side;
                        p[size_t((axis + 1) % 3)] = a + da[k];
                        p[size_t((axis + 2) % 3)] = b + db[k];
                        corner[k] = vertex(p);
                    }
                    if (side < 0) std::swap(corner[1], corner[3]);
                    for (int t : {1, 2})
                        faces << "f " << corner[0] << "//" << corner[0] << " " << corner[t] << "//" << corner[t] << " "
                              << corner[t + 1] << "//" << corner[t + 1] << "\n";
                }
    if (shared) REQUIRE(ids.size() == 26);
    return obj.str() + faces.str();
}

/// Scene with files next to it.
Scene scene_with(const std::string& xml, const std::vector<std::pair<std::string, std::string>>& files) {
    const test::TempFolder folder;
    for (const auto& [name, text] : files) folder.write(name, text);
    return load_mitsuba(folder.write("scene.xml", xml));
}

const std::string kGold =
    "<bsdf type='roughconductor'><string name='material' value='Au'/><float name='alpha' value='0.4'/></bsdf>";
const std::string kWhite = "<bsdf type='twosided'>" + diffuse({0.6f, 0.6f, 0.6f}) + "</bsdf>";

std::string rough_glass(double alpha) {
    return "<bsdf type='roughdielectric'><float name='alpha' value='" + number(alpha) +
           "'/><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf>";
}
std::string point_light(const std::string& place, Rgb intensity = {1, 1, 1}) {
    return "<emitter type='point'><point name='position' " + place + "/>" + rgb("intensity", intensity) + "</emitter>";
}

}  // namespace

// ---- shading normals and adjoints ----

TEST_CASE("B1: a point light in a bump-mapped sphere, every family of strategies, length by length",
          "[bidirectional]") {
    const test::TempFolder folder;
    Image waves{32, 32, {}};
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x)
            for (int c = 0; c < 3; ++c)
                waves.rgb.push_back(
                    float(0.5 + 0.25 * std::sin(2 * M_PI * x / 8) + 0.25 * std::cos(2 * M_PI * y / 16)));
    write_exr((folder.path / "waves.exr").string(), waves);
    const std::string bump =
        "<bsdf type='bumpmap'><texture type='bitmap'><string name='filename' value='waves.exr'/><boolean name='raw' "
        "value='true'/></texture><float name='scale' value='0.3'/>" +
        diffuse({0.7f, 0.6f, 0.5f}) + "</bsdf>";
    const Scene scene = load_mitsuba(
        folder.write("scene.xml", scene_xml(2, camera("0.5,0.1,0.2", "-1,0.2,0", 80) +
                                                   "<shape type='sphere'><boolean name='flip_normals' value='true'/>" +
                                                   bump + "</shape>" + point_light("x='-0.2' y='0.3' z='0.1'"))));
    agree_length_by_length(scene, 4, 96, 0.06);
}

TEST_CASE("B2: a coarse ball with radial normals, shared and unshared vertices, diffuse and rough metal",
          "[bidirectional]") {
    for (bool shared : {true, false})
        for (const std::string& bsdf : {diffuse({0.7f, 0.6f, 0.5f}), kGold}) {
            INFO((shared ? "shared " : "unshared ") << bsdf);
            const std::string xml =
                scene_xml(3, camera("0,-4,1.5", "0,0,0", 35) +
                                 "<shape type='obj'><string name='filename' value='ball.obj'/>" + bsdf +
                                 "</shape><shape type='rectangle'><transform name='to_world'><scale value='3'/>"
                                 "<translate z='-1.2'/></transform>" +
                                 kWhite + "</shape>" + lamp(1, 1, 1, -1, 3));
            const Scene scene = scene_with(xml, {{"ball.obj", round_cube(shared)}});
            agree(scene, {kLightTracer, kAll, {"next_event+connections+hits", MisHeuristic::power}}, 1024, 512, 0.12);
        }
}

TEST_CASE("B3: normals 60 degrees off, every family of strategies, length by length", "[bidirectional]") {
    const std::string quad =
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0.8660254 0 0.5\nvn -0.6 0.6 0.53\nf 1//1 2//2 3//1\nf 1//1 3//1 "
        "4//2\n";
    const std::string xml =
        scene_xml(2, camera("0,-3,2.5", "0,0,0.3", 45) +
                         "<shape type='obj'><string name='filename' value='quad.obj'/><bsdf type='twosided'>" +
                         diffuse({0.8f, 0.7f, 0.6f}) +
                         "</bsdf></shape><shape type='rectangle'><transform name='to_world'><rotate x='1' "
                         "angle='90'/><translate y='1' z='1'/></transform>" +
                         kWhite + "</shape>" + lamp(0.5, 0.5, 0.2, -0.3, 2));
    agree_length_by_length(scene_with(xml, {{"quad.obj", quad}}), 4, 128, 0.12);
}

TEST_CASE("B4: rays along surfaces and lights in their plane give no NaN", "[bidirectional]") {
    // The camera, the light and an edge of the cube lie in one plane; normals meet directions at right angles exactly.
    const Scene scene = scene_from_text(
        scene_xml(6, "<sensor type='orthographic'>" + lookat("origin='0,-3,1' target='0,0,1' up='0,0,1'") + film(32) +
                         "</sensor><shape type='cube'>" + kWhite + "</shape>" + point_light("x='0' y='0' z='1'") +
                         point_light("x='1' y='1' z='1'") + lamp(1, 1, 0, 0, 1.5) +
                         "<shape type='rectangle'><transform name='to_world'><scale value='5'/></transform>" + kWhite +
                         "</shape>"));
    for (const Method& m : {kAll, kPower, kLightTracer})
        CHECK(render_scene(scene, method_settings(scene, m, 1), 64).stats.invalid.total() == 0);
}

TEST_CASE("B6: light through refraction is scaled alike by subpaths from either end", "[bidirectional]") {
    const std::string floor =
        "<shape type='rectangle'><transform name='to_world'><scale value='3'/><translate z='-1'/></transform>" +
        kWhite + "</shape>";
    // A ball of rough glass in a constant environment, and over a floor; a camera and a lamp inside of it.
    const Scene furnace = scene_from_text(scene_xml(8, camera("0,-4,0", "0,0,0", 30) + "<shape type='sphere'>" +
                                                           rough_glass(0.4) + "</shape><emitter type='constant'/>"));
    agree(furnace, {kLightTracer}, 256, 2048, 0.12);
    agree(furnace, {kAll}, 256, 256, 0.02);
    const Scene inside =
        scene_from_text(scene_xml(5, camera("0,0,0.1", "1,0.3,-0.6", 70) + "<shape type='sphere'>" + rough_glass(0.3) +
                                         "</shape>" + floor + lamp(1, 1, 1.5, 0, 1.5)));
    agree(inside, {kLightTracer}, 2048, 2048, 0.3);
    agree(inside, {kAll}, 2048, 512, 0.2);
    const Scene lit = scene_from_text(scene_xml(
        5, camera("0,-5,1.5", "0,0,-0.4", 35) + "<shape type='sphere'>" + rough_glass(0.3) + "</shape>" + floor +
               "<shape type='sphere'><point name='center' x='0.1' y='0' z='0.1'/><float name='radius' value='0.3'/>" +
               diffuse({0.2f, 0.2f, 0.2f}) + area_light({2, 3, 4}) + "</shape>"));
    agree(lit, {kLightTracer, kAll}, 1024, 512, 0.12);
}

TEST_CASE("B6: a lamp behind a glass slab, segment by segment", "[bidirectional]") {
    const double r = std::pow(0.5 / 2.5, 2), t2 = (1 - r) * (1 - r);
    const std::string slab =
        "<shape type='cube'><transform name='to_world'><scale x='5' y='5' z='0.02'/></transform><bsdf "
        "type='dielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf></shape>";
    const std::string source =
        "<shape type='rectangle'><transform name='to_world'><scale value='5'/><translate z='-1'/></transform>" +
        diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";
    for (auto [depth, expected] : {std::pair{2, 0.0}, {3, t2}, {5, t2 * (1 + r * r)}, {-1, t2 / (1 - r * r)}}) {
        INFO("max_depth " << depth);
        const Scene scene = scene_from_text(scene_xml(depth, orthographic() + slab + source));
        if (expected == 0)
            check_black(render_scene(scene, method_settings(scene, kAll, 1), 16));
        else
            check_image(scene, method_settings(scene, kAll, 1), constant_image(kSize, kSize, kLight * float(expected)));
        // The camera sees nothing but glass: no light subpath can be connected with it.
        check_black(render_scene(scene, method_settings(scene, kLightTracer, 1), 16));
    }
}

// ---- lights ----

TEST_CASE("B7: a sun in a mirror lights the floor twice, and t = 1 alone finds the second time", "[bidirectional]") {
    const std::string mirror =
        "<shape type='rectangle'><transform name='to_world'><scale x='1.5' y='1.2'/><rotate x='1' angle='90'/><rotate "
        "z='1' angle='-90'/><translate x='2' z='2'/></transform><bsdf type='twosided'><bsdf type='conductor'><string "
        "name='material' value='none'/>" +
        rgb("specular_reflectance", {1, 1, 1}) + "</bsdf></bsdf></shape>";
    const Scene scene =
        plane_under(mirror + "<emitter type='directional'><vector name='direction' x='1' y='0' z='-1'/>" +
                        rgb("irradiance", kLight) + "</emitter>",
                    orthographic(), 3);
    const auto times = [](double n) { return plane_image(kLight, [n](double, double) { return n / std::sqrt(2.0); }); };
    for (const Method& m : {kAll, kPower, kLightTracer, Method{"next_event+light"}}) {
        INFO(m.name);
        check_image(scene, method_settings(scene, m, 1), times(2));
    }
    // Others have no strategy for light, mirror, floor, camera.
    check_image(scene, method_settings(scene, {"hits+next_event+connections"}, 1), times(1));
}

TEST_CASE("B9: a constant environment does not depend on what lies far away", "[bidirectional]") {
    const auto with = [](double distance) {
        return plane_under(
            "<emitter type='constant'>" + rgb("radiance", kLight) +
            "</emitter><shape type='sphere'><float name='radius' value='0.001'/><point name='center' x='" +
            number(distance) + "' y='0' z='0.5'/></shape>");
    };
    for (auto [distance, method] :
         {std::pair{1.5, kLightTracer}, {6, kLightTracer}, {1.5, kAll}, {6, kAll}, {150, kAll}, {150, kPower}}) {
        INFO(method.name << ", " << distance);
        const Scene scene = with(distance);
        check_image(scene, method_settings(scene, method, 1), plane_image(kLight, [](double, double) { return M_PI; }));
    }
    // White bodies vanish in it.
    for (const std::string& bsdf : {diffuse({1, 1, 1}), std::string("<bsdf type='dielectric'/>"),
                                    "<bsdf type='plastic'>" + rgb("diffuse_reflectance", {1, 1, 1}) +
                                        "<boolean name='nonlinear' value='true'/></bsdf>"}) {
        INFO(bsdf);
        const Scene scene = scene_from_text(scene_xml(1000, camera("0,-4,0", "0,0,0", 40) + "<shape type='sphere'>" +
                                                                bsdf + "</shape><emitter type='constant'>" +
                                                                rgb("radiance", kLight) + "</emitter>"));
        check_image(scene, method_settings(scene, kAll, 1), constant_image(16, 16, kLight));
    }
}

TEST_CASE("B10: several lights add up, whatever finds them", "[bidirectional]") {
    const std::string point = point_light("x='0.4' y='-0.3' z='0.8'", {0.5f, 0.5f, 0.5f}),
                      sun = "<emitter type='directional'><vector name='direction' x='1' y='-2' z='-2'/>" +
                            rgb("irradiance", {0.4f, 0.4f, 0.4f}) + "</emitter>";
    const Rgb dim = {0.5f, 0.5f, 0.5f};
    const auto of_lamp = [](double x, double y) {
        return 0.5 * rectangle_irradiance(x, y, -1.4, -0.2, -0.3, 0.5, 1.2);
    };
    const auto of_point = [](double x, double y) {
        return 0.5 * 0.8 / std::pow((x - 0.4) * (x - 0.4) + (y + 0.3) * (y + 0.3) + 0.64, 1.5);
    };
    const std::string panel = lamp(0.6, 0.4, -0.8, 0.1, 1.2, dim);
    for (const Method& m :
         {kAll, kLightTracer, Method{"next_event"}, Method{"next_event+light", MisHeuristic::power}}) {
        INFO(m.name);
        Scene scene = plane_under(panel + point);
        check_image(scene, method_settings(scene, m, 1),
                    plane_image({1, 1, 1}, [&](double x, double y) { return of_lamp(x, y) + of_point(x, y); }));
        scene = plane_under(point + sun);
        check_image(scene, method_settings(scene, m, 2),
                    plane_image({1, 1, 1}, [&](double x, double y) { return of_point(x, y) + 0.4 * 2.0 / 3; }));
        scene = plane_under("<emitter type='constant'>" + rgb("radiance", {0.2f, 0.2f, 0.2f}) + "</emitter>" + sun);
        check_image(scene, method_settings(scene, m, 3),
                    plane_image({1, 1, 1}, [&](double, double) { return 0.2 * M_PI + 0.4 * 2.0 / 3; }));
    }
}

TEST_CASE("B12: mirrored lamps with and without vertex normals shine to the same side in every strategy",
          "[bidirectional]") {
    for (bool normals : {false, true})
        for (bool mirrored : {false, true})
            for (bool two_sided : {false, true}) {
                INFO((normals ? "normals " : "") << (mirrored ? "mirrored " : "") << (two_sided ? "two-sided" : ""));
                const std::string triangle =
                    normals ? "v -0.6 -0.5 0\nv 0.7 -0.4 0\nv 0 0.6 0\nvn 0 0.1 1\nf 1//1 2//1 3//1\n"
                            : "v -0.6 -0.5 0\nv 0.7 -0.4 0\nv 0 0.6 0\nf 1 2 3\n";
                const std::string body = diffuse({0.3f, 0.3f, 0.3f});
                const std::string xml =
                    scene_xml(2, orthographic() + kPlane +
                                     "<shape type='rectangle'><transform name='to_world'><scale value='4'/><rotate "
                                     "x='1' angle='180'/><translate z='2.4'/></transform>" +
                                     kWhite +
                                     "</shape><shape type='obj'><string name='filename' value='t.obj'/>"
                                     // Without vertex normals a mirror turns the lamp upwards.
                                     "<boolean name='flip_normals' value='" +
                                     std::string(mirrored && !normals ? "true" : "false") +
                                     "'/><transform name='to_world'><scale x='" + std::string(mirrored ? "-1" : "1") +
                                     "'/><rotate x='1' angle='180'/><translate z='1.2'/></transform>" +
                                     (two_sided ? "<bsdf type='twosided'>" + body + "</bsdf>" : body) +
                                     area_light(kLight) + "</shape>");
                Scene scene = scene_with(xml, {{"t.obj", triangle}});
                scene.integrator.max_depth = 3;
                const Estimate path = render_path(scene, 512);
                for (const char* name : {"-i light", "hits", "next_event", "all"}) {
                    INFO(name);
                    check_agreement(scene, method_settings(scene, {name}, 1), 256, path, 0.08);
                }
            }
}

TEST_CASE("B13: a lamp of 200 unequal triangles shines as the rectangle that it is", "[bidirectional]") {
    std::ostringstream obj;
    const auto cut = [](int i) { return -0.6 + 1.2 * std::pow(i / 10.0, 2.5); };
    for (int j = 0; j <= 10; ++j)
        for (int i = 0; i <= 10; ++i) obj << "v " << cut(i) << " " << cut(j) * 2 / 3 << " 0\n";
    for (int j = 0; j < 10; ++j)
        for (int i = 0; i < 10; ++i) {
            const int a = j * 11 + i + 1;
            obj << "f " << a << " " << a + 1 << " " << a + 12 << "\nf " << a << " " << a + 12 << " " << a + 11 << "\n";
        }
    const std::string xml =
        scene_xml(2, orthographic() + kPlane +
                         "<shape type='obj'><string name='filename' value='lamp.obj'/><transform "
                         "name='to_world'><rotate x='1' angle='180'/><translate x='0.2' y='0.1' z='1.2'/></transform>" +
                         diffuse({0, 0, 0}) + area_light(kLight) + "</shape>");
    const Scene scene = scene_with(xml, {{"lamp.obj", obj.str()}});
    const Image expected =
        plane_image(kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); });
    for (const char* name : {"-i light", "next_event", "hits", "all"}) {
        INFO(name);
        check_image(scene, method_settings(scene, {name}, 1), expected);
    }
}

TEST_CASE("B14: a plane seen from 0 to 89 degrees has the radiance that its irradiance gives", "[bidirectional]") {
    for (double angle : {0.0, 45.0, 80.0, 89.0}) {
        INFO(angle << " degrees");
        const double a = angle * M_PI / 180, away = 0.5 + 0.35 * std::tan(a);  // the sensor stays above the floor
        const std::string view =
            "<sensor type='orthographic'><transform name='to_world'><scale value='0.3'/><lookat origin='" +
            number(away * std::sin(a)) + ",0," + number(away * std::cos(a)) +
            "' target='0,0,0' up='0,1,0'/></transform>" + film(8) + "</sensor>";
        const Scene scene = scene_from_text(
            scene_xml(2, view + "<shape type='rectangle'><transform name='to_world'><scale x='" +
                             number(0.5 / std::cos(a)) + "' y='0.5'/></transform>" + diffuse(kPlaneAlbedo) +
                             "</shape><emitter type='directional'><vector name='direction' x='0' y='0.5' z='-1'/>" +
                             rgb("irradiance", kLight) + "</emitter>"));
        const Image expected = constant_image(8, 8, kLight * kPlaneAlbedo * float(1 / std::sqrt(1.25) / M_PI));
        check_image(scene, method_settings(scene, kAll, 1), expected);
        // The more grazing, the less of the floor does the camera see that light subpaths reach.
        if (angle < 85) check_image(scene, method_settings(scene, kLightTracer, 2), expected);
    }
}

// ---- specular chains ----

TEST_CASE("B23: a glass ball between a small lamp and a floor: caustics by light subpaths, reflections by hits",
          "[bidirectional]") {
    const std::string ball =
        "<shape type='sphere'><point name='center' x='0' y='0' z='0.6'/><float name='radius' value='0.5'/><bsdf "
        "type='dielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf></shape>";
    // From the side; what the ball shows the camera has a delta next to it, which light subpaths cannot be connected
    // with.
    const Scene scene = scene_from_text(
        scene_xml(6, camera("0,-4,1.6", "0,0,0.3", 35) + ball + kPlane + lamp(0.3, 0.3, 0.5, 0, 2.2, {20, 20, 20})));
    agree(scene, {kAll, kPower, {"hits+light"}}, 4096, 512, 0.09);
    // From between ball and floor only the caustic is seen: t = 1 alone finds all of it, next event estimation none of
    // what passes the ball.
    const Scene below = scene_from_text(
        scene_xml(4,
                  "<sensor type='orthographic'><transform name='to_world'><scale value='0.4'/><lookat "
                  "origin='0,0,0.05' target='0,0,0' up='0,1,0'/></transform>" +
                      film(16) + "</sensor>" + ball + kPlane + lamp(0.3, 0.3, 0.5, 0, 2.2, {20, 20, 20})));
    agree(below, {kLightTracer, kAll, {"hits"}}, 4096, 512, 0.08);
}

// ---- geometry ----

TEST_CASE("B32: vertices that almost touch and a light next to a wall leave no fireflies", "[bidirectional]") {
    const std::string room =
        "<shape type='cube'><boolean name='flip_normals' value='true'/>" + diffuse({0.8f, 0.8f, 0.8f}) + "</shape>";
    const Scene scene = scene_from_text(
        scene_xml(6, camera("0.5,-0.9,0.2", "-1,1,-1", 60, 32) + room + point_light("x='0.999' y='0.3' z='0.1'")));
    const FilmMoments f = render_scene(scene, method_settings(scene, kAll, 1), 256).film;
    double mean = 0, largest = 0;
    for (size_t i = 0; i < f.sum.size(); ++i) {
        mean += f.mean(i) / double(f.sum.size());
        largest = std::max(largest, std::sqrt(f.sum_squares[i]));  // no sample of the pixel is larger
    }
    INFO("no sample is larger than " << largest / mean << " times the mean");
    CHECK(largest < 2000 * mean);
}

TEST_CASE("B33: a scene of any size has the same image", "[bidirectional]") {
    for (double scale : {1e-4, 1e-2, 1.0, 1e4}) {
        INFO("scale " << scale);
        const auto scaled = [&](const std::string& body) {
            return "<transform name='to_world'>" + body + "<scale value='" + number(scale) + "'/></transform>";
        };
        const std::string view =
            "<sensor type='perspective'><float name='fov' value='90'/><float name='near_clip' value='" +
            number(0.01 * scale) + "'/><float name='far_clip' value='" + number(100 * scale) + "'/>" +
            lookat("origin='0,0," + number(scale) + "' target='0,0,0' up='0,1,0'") + film(kSize) + "</sensor>";
        const Scene scene = scene_from_text(scene_xml(
            2, view + "<shape type='rectangle'>" + scaled("<scale value='1.5'/>") + diffuse(kPlaneAlbedo) +
                   "</shape><shape type='rectangle'>" +
                   scaled("<scale x='0.6' y='0.4'/><rotate x='1' angle='180'/><translate x='0.2' y='0.1' z='1.2'/>") +
                   diffuse({0, 0, 0}) + area_light(kLight) + "</shape>"));
        const Image expected = plane_image(
            kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); });
        for (const Method& m : {kLightTracer, kAll}) check_image(scene, method_settings(scene, m, 1), expected);
    }
}

TEST_CASE("B34, G11: surfaces of partial opacity dim every strategy's light alike and use up no depth",
          "[bidirectional]") {
    const auto sheet = [](double z, double opacity) {
        return "<shape type='rectangle'><transform name='to_world'><scale value='50'/><translate z='" + number(z) +
               "'/></transform><bsdf type='mask'><float name='opacity' value='" + number(opacity) + "'/>" +
               diffuse({0, 0, 0}) + "</bsdf></shape>";
    };
    const Image open =
        plane_image(kLight, [](double x, double y) { return rectangle_irradiance(x, y, -0.4, 0.8, -0.3, 0.5, 1.2); });
    const std::vector<std::pair<std::string, double>> cases = {{sheet(0.05, 0.3), 0.49},
                                                               {sheet(0.5, 0.3) + sheet(0.6, 0.3), 0.49},
                                                               {sheet(0.5, 0.3), 0.7},
                                                               {sheet(0.05, 0) + sheet(0.4, 0) + sheet(0.6, 0), 1}};
    for (const auto& [sheets, passes] : first_or_all(1, cases)) {
        const Scene scene = plane_under(lamp(0.6, 0.4, 0.2, 0.1, 1.2) + sheets);
        Image expected = open;
        for (float& v : expected.rgb) v *= float(passes);
        for (const char* name : {"-i light", "next_event", "hits", "all"}) {
            INFO(sheets << name);
            check_image(scene, method_settings(scene, {name}, 1), expected);
        }
    }
    // Connections across a sheet: a room with a veil between lamp and camera.
    const Scene room = scene_from_text(
        scene_xml(4, orthographic() + kPlane + lamp(0.6, 0.4, 0.2, 0.1, 1.2) +
                         "<shape type='rectangle'><transform name='to_world'><scale value='2'/><rotate x='1' "
                         "angle='90'/><translate y='1.2' z='1'/></transform>" +
                         kWhite +
                         "</shape><shape type='rectangle'><transform name='to_world'><scale value='50'/><translate "
                         "z='0.4'/></transform><bsdf type='mask'><float name='opacity' value='0.4'/>" +
                         diffuse({0.5f, 0.5f, 0.5f}) + "</bsdf></shape>"));
    agree_length_by_length(room, 4, 256, 0.2);
}
