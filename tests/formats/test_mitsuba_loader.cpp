// libs: ambilux_convert ambilux_formats ambilux_accel JPEG::JPEG
// data: tagged
// timeout: 120
// The Mitsuba loader: what it understands, and what it says about what it does not. Numbers marked "Mitsuba" were read
// from Mitsuba 3.9.1.
#include <fmt/format.h>
#include <algorithm>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/math.h"
#include "formats/convert/convert.h"
#include "formats/load.h"
#include "integrators/feature_levels.h"
#include "scene/info.h"
#include "tests/support/catch.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/skip.h"
#include "tests/support/temp_folder.h"
#include "transport/bsdf/precompute.h"
#include "transport/texture.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

std::string data_folder() {
    const char* folder = std::getenv("AMBILUX_DATA");
    if (!folder) skip("AMBILUX_DATA is not set: the published scenes are not loaded");
    return folder ? folder : "";
}

}  // namespace

TEST_CASE("published scenes load without a warning, with the triangles their README lists", "[data]") {
    const std::string data = data_folder();
    if (data.empty()) return;
    struct Expected {
        const char* name;
        uint64_t triangles;
        size_t quadrics, shapes, emitters;
    };
    const Expected scenes[] = {{"veach-bidir", 11544, 0, 0, 2},    {"veach-ajar", 382690, 0, 22, 1},
                               {"veach-mis", 52, 3, 0, 3},         {"cornell-box", 36, 0, 8, 1},
                               {"water-caustic", 103487, 0, 0, 1}, {"living-room", 143163, 0, 65, 1},
                               {"staircase", 262663, 0, 775, 1},   {"glass-and-ice", 150594, 0, 16, 1}};
    for (const Expected& e : scenes) {
        INFO(e.name);
        const Scene s = load_mitsuba(data + "/scenes/" + e.name + "/scene.xml");
        CHECK(s.warnings.empty());
        CHECK(s.triangles.size() + s.degenerate_triangles == e.triangles);
        CHECK(s.quadrics.size() == e.quadrics);
        if (e.shapes) CHECK(s.shapes.size() == e.shapes);
        CHECK(s.emitters.size() == e.emitters);
        CHECK(s.bounds_radius > 0);
    }
}

TEST_CASE("Mitsuba's render tests load, but for what is refused by name", "[data]") {
    const std::string data = data_folder();
    if (data.empty()) return;
    const std::string tests = data + "/mitsuba-tests/tests/scenes/";
    for (const char* name :
         {"bsdf_spheres/test_arealight_path", "bsdf_spheres/test_constant_path", "bsdf_spheres/test_pointlight_path",
          "floating_sphere/test_directional_direct", "instancing/test_instancing_path",
          "orthographic_sensor/test_orthographic_path", "spot_light/test_spot_direct",
          "texture_interp/test_texture_interp_direct", "mesh_attributes/test_mesh_attributes_3_vertex_direct"}) {
        INFO(name);
        const Scene s = load_mitsuba(tests + name + ".xml");
        CHECK(s.warnings.empty());
    }
    const Scene s = load_mitsuba(tests + "various_shapes/test_various_shapes_path.xml");
    CHECK(s.warnings.empty());
    CHECK(s.quadrics.size() == 3);
    CHECK(has_note(s, "'sdfgrid' are triangles"));
}

TEST_CASE("both generations of the format give the same scene") {
    const test::TempFolder folder;
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
    const Scene modern = load(
        "<integrator type='path'><integer name='max_depth' value='9'/><integer name='rr_depth' value='4'/></integrator>"
        "<sensor type='thinlens'><float name='fov' value='40'/><string name='fov_axis' value='smaller'/><float "
        "name='aperture_radius' value='0.1'/>"
        "<float name='focus_distance' value='3'/><transform name='to_world'><lookat origin='0,0,4' target='0,0,0' "
        "up='0,1,0'/></transform>"
        "<sampler type='independent'><integer name='sample_count' value='32'/></sampler>"
        "<film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='48'/><string "
        "name='pixel_format' value='rgb'/><rfilter type='tent'/></film></sensor>"
        "<bsdf type='roughdielectric' id='g'><string name='int_ior' value='water'/><float name='ext_ior' "
        "value='1'/><float name='alpha_u' value='0.2'/><float name='alpha_v' value='0.3'/></bsdf>"
        "<shape type='obj'><string name='filename' value='m.obj'/><boolean name='face_normals' "
        "value='true'/><transform name='to_world'><scale value='2'/></transform><ref id='g'/></shape>"
        "<emitter type='spot'><rgb name='intensity' value='1,2,3'/><float name='cutoff_angle' value='30'/></emitter>",
        {}, "3.0.0", &folder);
    const Scene old = load(
        "<integrator type='path'><integer name='maxDepth' value='9'/><integer name='rrDepth' value='4'/></integrator>"
        "<sensor type='thinlens'><float name='fov' value='40'/><string name='fovAxis' value='smaller'/><float "
        "name='apertureRadius' value='0.1'/>"
        "<float name='focusDistance' value='3'/><transform name='toWorld'><lookAt origin='0,0,4' target='0,0,0' "
        "up='0,1,0'/></transform>"
        "<sampler type='ldsampler'><integer name='sampleCount' value='32'/></sampler>"
        "<film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='48'/><string "
        "name='pixelFormat' value='rgb'/><boolean name='banner' value='false'/><rfilter type='tent'/></film></sensor>"
        "<bsdf type='roughdielectric' id='g'><string name='intIOR' value='water'/><float name='extIOR' "
        "value='1'/><float name='alphaU' value='0.2'/><float name='alphaV' value='0.3'/></bsdf>"
        "<shape type='obj'><string name='filename' value='m.obj'/><boolean name='faceNormals' value='true'/><transform "
        "name='toWorld'><scale value='2'/></transform><ref id='g'/></shape>"
        "<emitter type='spot'><spectrum name='intensity' value='1,2,3'/><float name='cutoffAngle' "
        "value='30'/></emitter>",
        {}, "0.6.0", &folder);
    REQUIRE(modern.vertices.size() == old.vertices.size());
    for (size_t i = 0; i < old.vertices.size(); ++i) CHECK(modern.vertices[i].p == old.vertices[i].p);
    CHECK(modern.integrator.max_depth == 9);
    CHECK(old.integrator.max_depth == 9);
    CHECK(old.integrator.rr_depth == 4);
    CHECK(old.integrator.spp == 32);
    CHECK(memcmp(&modern.sensor, &old.sensor, sizeof(Sensor)) == 0);
    CHECK(memcmp(modern.bsdfs.data(), old.bsdfs.data(), sizeof(BsdfRecord)) == 0);
    CHECK(memcmp(modern.emitters.data(), old.emitters.data(), sizeof(Emitter)) == 0);
    CHECK(modern.tables == old.tables);
    CHECK(modern.content_hash != old.content_hash);
    CHECK(modern.vertices[1].p == Vec3f{2, 0, 0});
    CHECK_FALSE(modern.shapes[0].flags & kShapeHasNormals);
    // Names of the other generation are unknown parameters, not ignored ones.
    CHECK(contains(error_of("<shape type='rectangle'><transform name='toWorld'/></shape>"),
                   "unknown parameter 'toWorld' of shape 'rectangle'"));
}

TEST_CASE("defaults, parameters, includes, search folders, aliases, references") {
    const test::TempFolder folder;
    folder.write("parts/light.xml", wrap("<default name='power' value='3'/><emitter type='point'><rgb name='intensity' "
                                         "value='$power'/></emitter><shape type='obj'><string name='filename' "
                                         "value='tri.obj'/><ref id='second'/></shape>",
                                         "2.1.0"));
    folder.write("meshes/tri.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const std::string body =
        "<default name='w' value='40'/><default name='wide' value='60'/><path value='meshes'/>"
        "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='$wide'/><integer name='height' "
        "value='$w'/></film></sensor>"
        "<bsdf type='diffuse' id='first'><rgb name='reflectance' value='0.25'/></bsdf><alias id='first' "
        "as='second'/><include filename='parts/light.xml'/>";
    const Scene s = load(body, {}, "3.0.0", &folder);
    CHECK(s.sensor.film_width == 60);  // the longest name wins
    CHECK(s.sensor.film_height == 40);
    REQUIRE(s.emitters.size() == 1);
    CHECK(s.emitters[0].radiance.value.x == 3.0f);
    CHECK(parameters<Diffuse>(s.bsdfs[0]).reflectance.value.x == 0.25f);

    LoadOptions options;
    options.parameters = {{"power", "7"}};
    const Scene t = load(body, options, "3.0.0", &folder);
    CHECK(t.emitters[0].radiance.value.x == 7.0f);
    CHECK(t.content_hash != s.content_hash);
    options.parameters = {{"nothing", "7"}};
    CHECK(contains(error_of(body, options, "3.0.0", &folder), "the scene has no parameter '$nothing'"));
}

TEST_CASE("content hash: changes with any file, not with its place") {
    const std::string body = "<shape type='obj'><string name='filename' value='m.obj'/></shape>";
    const auto hash = [&](const std::string& obj, const std::string& xml, const LoadOptions& options = {}) {
        const test::TempFolder folder;
        folder.write("m.obj", obj);
        return load(xml, options, "3.0.0", &folder).content_hash;
    };
    const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    const auto first = hash(obj, body);
    CHECK(first == hash(obj, body));
    CHECK(first != hash(obj + "#\n", body));
    CHECK(first != hash(obj, body + " "));
    LoadOptions small;
    small.width = small.height = 32;
    CHECK(first != hash(obj, body, small));
}

TEST_CASE("transforms: later steps apply after earlier ones") {
    const auto moved = [](const std::string& steps) {
        // The rectangle's corner (1,1,0), third vertex.
        return load("<shape type='rectangle'><transform name='to_world'>" + steps + "</transform></shape>")
            .vertices[2]
            .p;
    };
    check_rgb(moved("<translate x='1' y='2' z='3'/>"), {2, 3, 3});
    check_rgb(moved("<translate value='1 2 3'/><scale value='2'/>"), {4, 6, 6});
    check_rgb(moved("<scale x='2' z='5'/><translate value='1,2,3'/>"), {3, 3, 3});
    check_rgb(moved("<rotate z='1' angle='90'/>"), {-1, 1, 0});
    check_rgb(moved("<rotate value='0 2 0' angle='90'/>"), {0, 1, -1});
    check_rgb(moved("<matrix value='1 0 0 7  0 1 0 8  0 0 1 9  0 0 0 1'/>"), {8, 9, 9});
    check_rgb(moved("<matrix value='0 1 0  2 0 0  0 0 1'/>"), {1, 2, 0});
    // Camera frame: x left, y up, z ahead.
    check_rgb(moved("<lookat origin='0 0 5' target='0 0 0' up='0 1 0'/>"), {-1, 1, 5});
    const Scene s = load(
        "<sensor type='perspective'><transform name='to_world'><lookat origin='1,2,3' target='1,2,13' "
        "up='0,3,0'/></transform></sensor>");
    check_rgb(s.sensor.to_world.vector({0, 0, 1}), {0, 0, 1});
    check_rgb(s.sensor.to_world.vector({1, 0, 0}), {1, 0, 0});
    check_rgb(s.sensor.to_world.point({0, 0, 0}), {1, 2, 3});
}

TEST_CASE("a scene far from the origin is moved there, also if only the vertices of its mesh file say so") {
    const test::TempFolder folder;
    const auto mesh = [&](double x) {
        folder.write("m.obj", fmt::format("v {} 0 0\nv {} 0 0\nv {} 1 0\nf 1 2 3\n", x, x + 1, x));
        const std::string camera = fmt::format(
            "<sensor type='perspective'><transform name='to_world'><lookat origin='{0},0,2' target='{0},0,0' "
            "up='0,1,0'/></transform></sensor>",
            x);
        return load(camera + "<shape type='obj'><string name='filename' value='m.obj'/></shape>", {}, "3.0.0", &folder);
    };
    const Scene near = mesh(4), far = mesh(1048576);
    CHECK(near.origin == std::array<double, 3>{});
    CHECK(near.vertices[0].p.x == 4);
    CHECK(far.origin[0] == 1048576.5);
    CHECK(far.vertices[0].p.x == -0.5f);
    CHECK(far.vertices[1].p.x == 0.5f);
    CHECK(far.sensor.to_world.m[0][3] == -0.5f);
}

TEST_CASE("sensors: field of view by every rule, film, crop, size override") {
    const auto sensor = [](const std::string& xml,
                           const std::string& film =
                               "<integer name='width' value='200'/><integer name='height' value='100'/>",
                           const LoadOptions& options = {}) {
        return load("<sensor type='perspective'>" + xml + "<film type='hdrfilm'>" + film + "</film></sensor>", options)
            .sensor;
    };
    const auto fov = [](float t) { return 2 * std::atan(t) * 180 / M_PI; };
    const std::string f60 = "<float name='fov' value='60'/><string name='fov_axis' value='";
    CHECK(fov(sensor(f60 + "x'/>").tan_half_fov.x) == Approx(60));
    CHECK(fov(sensor(f60 + "y'/>").tan_half_fov.y) == Approx(60));
    CHECK(fov(sensor(f60 + "smaller'/>").tan_half_fov.y) == Approx(60));
    CHECK(fov(sensor(f60 + "larger'/>").tan_half_fov.x) == Approx(60));
    const Vec2f d = sensor(f60 + "diagonal'/>").tan_half_fov;
    CHECK(fov(std::sqrt(d.x * d.x + d.y * d.y)) == Approx(60));
    CHECK(d.x == Approx(2 * d.y));
    const Sensor standard = load("<sensor type='perspective'/>").sensor;
    CHECK(standard.film_width == 768);
    CHECK(standard.film_height == 576);
    CHECK(fov(standard.tan_half_fov.x) == Approx(38.1848).epsilon(1e-5));  // Mitsuba: 50 mm
    CHECK(standard.filter == FilterType::gaussian);
    CHECK(standard.filter_radius == 2.0f);
    CHECK(standard.near_clip == 0.01f);
    CHECK(standard.far_clip == 10000.0f);
    CHECK(fov(sensor("<string name='focal_length' value='25mm'/>").tan_half_fov.x) ==
          Approx(2 * std::atan(std::sqrt(36.0 * 36 + 24 * 24) / 50 * 2 / std::sqrt(5.0)) * 180 / M_PI));

    const std::string film =
        "<integer name='width' value='200'/><integer name='height' value='100'/><integer name='crop_offset_x' "
        "value='20'/><integer name='crop_offset_y' value='10'/>"
        "<integer name='crop_width' value='50'/><integer name='crop_height' value='60'/><rfilter "
        "type='gaussian'><float name='stddev' value='0.25'/></rfilter>";
    const Sensor cropped = sensor("", film);
    CHECK(std::array<uint32_t, 4>{cropped.crop_x, cropped.crop_y, cropped.crop_width, cropped.crop_height} ==
          std::array<uint32_t, 4>{20, 10, 50, 60});
    CHECK(cropped.filter_radius == 1.0f);
    LoadOptions half;
    half.width = 100;
    half.height = 50;
    const Sensor scaled = sensor("", film, half);
    CHECK(scaled.film_width == 100);
    CHECK(std::array<uint32_t, 4>{scaled.crop_x, scaled.crop_y, scaled.crop_width, scaled.crop_height} ==
          std::array<uint32_t, 4>{10, 5, 25, 30});

    const Sensor ortho = load(
                             "<sensor type='orthographic'><transform name='to_world'><scale x='1.5' y='3'/><translate "
                             "x='4'/></transform>"
                             "<film type='hdrfilm'><integer name='width' value='200'/><integer name='height' "
                             "value='100'/><rfilter type='box'/></film></sensor>")
                             .sensor;
    CHECK(ortho.type == SensorType::orthographic);
    CHECK(ortho.tan_half_fov.x == Approx(1.5));
    CHECK(ortho.tan_half_fov.y == Approx(1.5));  // 3 over the aspect ratio
    check_rgb(ortho.to_world.vector({1, 0, 0}), {1, 0, 0});
    CHECK(ortho.filter == FilterType::box);
    // A mirrored camera stays mirrored.
    const Sensor mirrored =
        load("<sensor type='perspective'><transform name='to_world'><scale x='-1'/></transform></sensor>").sensor;
    check_rgb(mirrored.to_world.vector({1, 0, 0}), {-1, 0, 0});
    check_rgb(mirrored.to_world.vector({0, 0, 1}), {0, 0, 1});
}

TEST_CASE("sensors: a spherical one has a place and a turn, and nothing to clip or to focus") {
    const std::string sensor =
        "<sensor type='spherical'><transform name='to_world'><rotate y='1' angle='90'/><translate x='3'/></transform>";
    const Scene s = load(sensor + "</sensor>");
    CHECK(s.sensor.type == SensorType::spherical);
    CHECK(s.features.latlong);
    CHECK_FALSE(kCommonFeatures.covers(s.features));
    CHECK(kFlatFeatures.covers(s.features));
    CHECK_FALSE(load("<sensor type='thinlens'><float name='aperture_radius' value='1'/></sensor>").features.latlong);
    check_rgb(s.sensor.to_world.vector({0, 0, 1}), {1, 0, 0});
    check_rgb(s.sensor.to_world.point({0, 0, 0}), {3, 0, 0});
    CHECK(s.sensor.far_clip == kInfinity);
    const nlohmann::json info = scene_info(s);
    CHECK(info["sensor"] == nlohmann::json{{"type", "spherical"}});
    CHECK(load("<sensor type='spherical'><float name='shutterOpen' value='1'/></sensor>", {}, "0.6.0").sensor.type ==
          SensorType::spherical);
    CHECK(contains(error_of(sensor + "<float name='fov' value='40'/></sensor>"), "fov"));
    CHECK(contains(
        error_of("<sensor type='spherical'><transform name='to_world'><scale value='2'/></transform></sensor>"),
        "must not scale or shear"));
    // Written and read again; Mitsuba 3 has none.
    const test::TempFolder folder;
    const std::string path = folder / "out.xml";
    const std::vector<std::string> notes = write_mitsuba(s, path);
    CHECK(std::count(notes.begin(), notes.end(), "Mitsuba 3 has no sensor 'spherical'") == 1);
    const Sensor again = load_mitsuba(path).sensor;
    CHECK(again.type == SensorType::spherical);
    CHECK(std::equal(&again.to_world.m[0][0], &again.to_world.m[0][0] + 12, &s.sensor.to_world.m[0][0],
                     [](float a, float b) { return std::fabs(a - b) < 1e-6f; }));
}

TEST_CASE("integrators: the inner one of moment counts, direct is two segments") {
    CHECK(load("<integrator type='moment'><integrator type='direct'/></integrator>").integrator.max_depth == 2);
    const Scene s = load(
        "<integrator type='moment'><integrator type='path'><integer name='max_depth' value='-1'/><boolean "
        "name='hide_emitters' value='true'/></integrator></integrator>");
    CHECK(s.integrator.type == "path");
    CHECK(s.integrator.max_depth == -1);
    CHECK(s.integrator.hide_emitters);
    CHECK(contains(error_of("<integrator type='depth'/>"), ":2: integrator type 'depth' is not supported"));
}

TEST_CASE("emitters: values, frames, one environment") {
    const test::TempFolder folder;
    folder.write("e.png", png_bytes(4, 3, std::vector<uint8_t>(36, 255)));
    const auto one = [&](const std::string& xml) { return load(xml, {}, "3.0.0", &folder).emitters[0]; };
    Emitter e =
        one("<emitter type='point'><transform name='to_world'><translate z='10'/></transform><rgb name='intensity' "
            "value='100'/></emitter>");
    CHECK(e.position == Vec3f{0, 0, 10});
    CHECK(e.radiance.value == splat(100));
    CHECK(one("<emitter type='point'><point name='position' x='1' y='2' z='3'/></emitter>").position == Vec3f{1, 2, 3});
    e = one("<emitter type='directional'><vector name='direction' value='0,0,-4'/></emitter>");
    CHECK(e.direction == Vec3f{0, 0, -1});
    CHECK(e.radiance.value == splat(1));
    e =
        one("<emitter type='spot'><transform name='to_world'><lookat origin='1,1,1' target='1,1,9' "
            "up='0,1,0'/></transform><texture name='texture' type='bitmap'><string name='filename' "
            "value='e.png'/></texture></emitter>");
    CHECK(e.one_minus_cos_cutoff == Approx(1 - std::cos(20 * M_PI / 180)));
    CHECK(e.cutoff == Approx(20 * M_PI / 180));
    CHECK(e.beam_width == Approx(15 * M_PI / 180));
    CHECK(e.radiance.texture == 0);
    check_rgb(e.direction, {0, 0, 1});
    check_rgb(e.to_local.point({1, 1, 2}), {0, 0, 1});
    const Scene env = load(
        "<emitter type='envmap'><string name='filename' value='e.png'/><float name='scale' value='3'/><transform "
        "name='to_world'><rotate y='1' angle='90'/></transform></emitter>",
        {}, "3.0.0", &folder);
    CHECK(env.environment == 0);
    CHECK(env.emitters[0].radiance.value == splat(3));
    CHECK(env.textures[0].format == TexelFormat::rgba16f);
    check_rgb(env.emitters[0].to_world.vector({0, 0, 1}), {1, 0, 0});
    CHECK_FALSE(env.features.textures);
    const Scene area =
        load("<shape type='sphere'><emitter type='area'><rgb name='radiance' value='1,2,3'/></emitter></shape>");
    CHECK(area.shapes[0].emitter == 0);
    CHECK(area.emitters[0].shape == 0);
    CHECK(area.emitters[0].pick_probability == 1.0f);
    const std::string bright =
        "<texture type='checkerboard' name='radiance' id='t'><rgb name='color0' value='7'/></texture>";
    CHECK(load("<shape type='cube'><emitter type='area'>" + bright + "</emitter></shape>").textures[0].color0 ==
          splat(7));
    CHECK(contains(
        error_of(bright + "<shape type='cube'><bsdf type='diffuse'><ref id='t' name='reflectance'/></bsdf></shape>"),
        "'color0' is larger than 1"));
    CHECK(contains(error_of("<emitter type='constant'/>\n<emitter type='constant'/>"),
                   ":3: only one constant, envmap or sky"));
    CHECK(contains(error_of("<emitter type='point'><rgb name='intensity' value='-1'/></emitter>"),
                   "'intensity' is negative"));
    CHECK(contains(error_of("<emitter type='beam'/>"), "emitter type 'beam' is not supported"));
}

TEST_CASE("lights that scale alike along all axes are those without scale, but for the irradiance of projectors") {
    const auto light = [](const std::string& type, const std::string& scale) {
        return load("<emitter type='" + type + "'><transform name='to_world'>" + scale +
                    "<lookat origin='1,2,3' target='0,0,0' up='0,1,0'/></transform></emitter>")
            .emitters[0];
    };
    const auto same = [](const Affine& a, const Affine& b) {
        return std::equal(&a.m[0][0], &a.m[0][0] + 12, &b.m[0][0],
                          [](float x, float y) { return std::fabs(x - y) < 1e-6f; });
    };
    for (const char* type : {"point", "spot", "projector", "directional", "collimated", "constant", "sunsky"}) {
        INFO(type);
        const Emitter plain = light(type, "");
        for (const char* scale : {"<scale value='2'/>", "<scale value='0.01'/>"}) {
            const Emitter scaled = light(type, scale);
            check_rgb(scaled.position, plain.position);
            check_rgb(scaled.direction, plain.direction);
            CHECK(same(scaled.to_world, plain.to_world));
            CHECK(same(scaled.to_local, plain.to_local));
        }
        // As in Mitsuba 3.9.
        const float larger = type == std::string("projector") ? 2 : 1;
        check_rgb(light(type, "<scale value='2'/>").radiance.value, larger * plain.radiance.value);
        if (plain.to_world.m[0][0] == 1) continue;
        CHECK(contains(error_of(std::string("<emitter type='") + type +
                                "'><transform name='to_world'><scale x='2'/></transform></emitter>"),
                       "must not shear, or scale one axis more than another"));
    }
    CHECK(contains(error_of("<emitter type='spot'><transform name='to_world'><scale value='0'/></transform></emitter>"),
                   "the emitter's transform is singular"));
}

TEST_CASE("environment maps are stored as halves unless that loses something") {
    const test::TempFolder folder;
    // Radiance's RGBE: mantissas over 256 times 2^(exponent-128); two texels, neither compressed.
    const auto texels = [&](std::vector<uint8_t> rgbe) {
        folder.write("e.hdr",
                     "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n" + std::string(rgbe.begin(), rgbe.end()));
        return load("<emitter type='envmap'><string name='filename' value='e.hdr'/></emitter>", {}, "3.0.0", &folder);
    };
    const auto check = [&](const Scene& s, TexelFormat format, Rgb first, Rgb second) {
        REQUIRE(s.textures[0].format == format);
        CHECK(load_texel(s.view(), s.textures[0], 0, 0) == first);
        CHECK(load_texel(s.view(), s.textures[0], 1, 0) == second);
    };
    check(texels({128, 64, 0, 129, 192, 255, 1, 144}), TexelFormat::rgba16f, {1, 0.5f, 0}, {49152, 65280, 256});
    check(texels({128, 64, 0, 129, 192, 255, 1, 145}), TexelFormat::rgba32f, {1, 0.5f, 0},
          {98304, 130560, 512});  // beyond the largest half
    check(texels({128, 64, 0, 129, 129, 128, 0, 106}), TexelFormat::rgba32f, {1, 0.5f, 0},
          {129 * 0x1p-30f, 0x1p-23f, 0});  // a denormal half of few bits
}

TEST_CASE("mistakes are named with file and line") {
    const test::TempFolder folder;
    folder.write("nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    folder.write("range.obj", "v 0 0 0\nf 1 2 3\n");
    folder.write("self.xml", wrap("<include filename='self.xml'/>", "3.0.0"));
    folder.write("notscene.xml", "<bsdf type='diffuse'/>");
    folder.write("outer.xml", wrap("<include filename='wrong.xml'/>", "3.0.0"));
    folder.write("wrong.xml", wrap("<shape type='rectangle'><bsdf type='plaid'/></shape>", "3.0.0"));
    folder.write("bad.png", "no image");
    const std::pair<const char*, const char*> cases[] = {
        {"<bsdf type='diffuse'", "scene.xml:"},
        {"\n\n<bsdf type='diffuse'></bsd>", "scene.xml:4: XML error"},
        {"\n<shape type='rectangle'><ref id='nobody'/></shape>", "scene.xml:3: reference to unknown id 'nobody'"},
        {"<bsdf type='diffuse' id='a'/>\n<bsdf type='diffuse' id='a'/>", "scene.xml:3: id 'a' is already used at "},
        {"<include filename='self.xml'/>", "self.xml:2: circular include of "},
        {"<include filename='notscene.xml'/>", "notscene.xml:1: the outermost element is not <scene> (included by "},
        {"<include filename='outer.xml'/>", "wrong.xml:2: BSDF type 'plaid' is not supported (included by "},
        {"<include filename='outer.xml'/>", "outer.xml:2, by "},
        {"<include filename='outer.xml'/>", "scene.xml:2)"},
        {"<include filename='missing.xml'/>", "scene.xml:2: file 'missing.xml' does not exist"},
        {"\n<shape type='$kind'/>", "scene.xml:3: parameter '$kind' has no value and no <default>"},
        {"<shape type='obj'>\n<string name='filename' value='missing.obj'/></shape>",
         "scene.xml:3: file 'missing.obj' does not exist"},
        {"<shape type='obj'><string name='filename' value='nan.obj'/></shape>",
         "nan.obj: position of vertex 1 is not finite"},
        {"<shape type='obj'><string name='filename' value='range.obj'/></shape>",
         "range.obj:2: vertex index 2 is out of range"},
        {"<shape type='obj'/>", "scene.xml:2: obj shape has no filename"},
        {"<shape type='obj'><string name='file_name' value='a.obj'/></shape>",
         "unknown parameter 'file_name' of shape 'obj': 'filename' is known"},
        {"<shape type='sdfgrid'><string name='filenam' value='a.vol'/></shape>",
         "unknown parameter 'filenam' of shape 'sdfgrid': 'filename' is known"},
        {"<shape type='cube'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'><string name='flename' "
         "value='a.png'/></texture></bsdf></shape>",
         "unknown parameter 'flename' of texture 'bitmap': 'filename' is known"},
        {"<emitter type='envmap'><string name='Filename' value='a.exr'/></emitter>",
         "unknown parameter 'Filename' of emitter 'envmap': 'filename' is known"},
        {"<shape type='obj'><string name='filename' value='line.obj'/><emitter type='area'/></shape>",
         "scene.xml:2: the shape emits light but has no area"},
        {"<shape type='rectangle'>\n<float name='colour' value='1'/></shape>",
         "scene.xml:3: unknown parameter 'colour' of shape 'rectangle'"},
        {"<bsdf type='diffuse' id='unused'>\n<float name='colour' value='1'/></bsdf>",
         "scene.xml:3: unknown parameter 'colour' of bsdf 'diffuse'"},
        {"<shape type='rectangle'><bsdf type='measured'/></shape>",
         "scene.xml:2: BSDF type 'measured' is not supported"},
        {"<shape type='rectangle'>\n<bsdf type='diffuse'><texture type='noise' name='reflectance'/></bsdf></shape>",
         "scene.xml:3: texture type 'noise' is not supported"},
        {"<shape type='rectangle'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'><string "
         "name='filename' value='bad.png'/></texture></bsdf></shape>",
         "bad.png: cannot read image"},
        {"<shape type='rectangle'><bsdf type='diffuse'><rgb name='reflectance' value='1,2'/></bsdf></shape>",
         "<rgb> needs one or three numbers, not 2"},
        {"<shape type='rectangle'><bsdf type='diffuse'><rgb name='reflectance' value='2'/></bsdf></shape>",
         "'reflectance' is larger than 1"},
        {"<shape type='rectangle'><bsdf type='conductor'><string name='material' value='Unobtainium'/></bsdf></shape>",
         "no optical constants are known for 'Unobtainium'"},
        {"<shape type='rectangle'><bsdf type='dielectric'><string name='int_ior' value='jelly'/></bsdf></shape>",
         "no index of refraction is known for 'jelly'"},
        {"<shape type='rectangle'><bsdf type='roughconductor'><string name='distribution' "
         "value='blinn'/></bsdf></shape>",
         "microfacet distribution 'blinn' is not supported"},
        {"<shape type='rectangle'><transform name='to_world'><scale x='0'/></transform></shape>",
         "the transform of the shape is singular"},
        {"<shape type='rectangle'><transform name='to_world'>\n<twist/></transform></shape>",
         "scene.xml:3: unknown element <twist> in <transform>"},
        {"<shape type='rectangle'><transform name='to_world'><matrix value='1 2 3'/></transform></shape>",
         "<matrix> needs 16 or 9 numbers, not 3"},
        {"<sensor type='perspective'><transform name='to_world'><lookat origin='0,0,0' target='0,0,0' "
         "up='0,1,0'/></transform></sensor>",
         "<lookat> is degenerate"},
        {"<sensor type='perspective'><transform name='to_world'><scale value='2'/></transform></sensor>",
         "must not scale or shear"},
        {"<sensor type='perspective'><float name='fov' value='200'/></sensor>", "fov must lie between 0 and 180"},
        {"<sensor type='perspective'><float name='fov' value='nan'/></sensor>", "'nan' is not a number (float)"},
        {"<sensor type='perspective'><film type='hdrfilm'><rfilter type='sharp'/></film></sensor>",
         "reconstruction filter 'sharp' is not supported"},
        {"<sensor type='perspective'><film type='hdrfilm'><integer name='crop_width' value='9999'/></film></sensor>",
         "the crop window is not inside of the film"},
        {"<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='1.5'/></film></sensor>",
         "'1.5' is not an integer"},
        {"<sensor type='thinlens'/>", "thinlens has no aperture_radius"},
        {"<bsdf type='mask' id='m'><ref id='m'/></bsdf>", "circular reference to id 'm'"},
        {"<medium type='homogeneous' id='m'/><shape type='sphere'><ref id='m' name='interior'/></shape>",
         "not supported: medium 'homogeneous' (name 'interior') in shape 'sphere'"},
        {"<thing/>", "scene.xml:2: unknown element <thing>"},
        {"<shap type='sphere'/>", "unknown element <shap>: <shape> is known"},
        {"<sphere/>", "unknown element <sphere>: 'sphere' is a type of <shape>"},
        {"<shape type='spere'/>", "shape type 'spere' is not supported: 'sphere' is known"},
        {"<shape type='diffuse'/>", "shape type 'diffuse' is not supported: it is of <bsdf>"},
        {"<shape type='cube'><bsdf type='difuse'/></shape>", "BSDF type 'difuse' is not supported: 'diffuse' is known"},
        {"<emitter type='area'/>", "emitter type 'area' is not supported here: it belongs in a shape"},
        {"<emitter type='pointt'/>", "emitter type 'pointt' is not supported: 'point' is known"},
        {"<shape type='cube'><emitter type='spot'/></shape>", "on a shape is not supported: it belongs in the scene"},
        {"<sensor type='perspectiv'/>", "sensor type 'perspectiv' is not supported: 'perspective' is known"},
        {"<shape type='rectangle' colour='red'/>", "unexpected attribute 'colour' in <shape>"},
        {"<shape type='sphere'><float name='radius' valeu='2'/></shape>",
         "unexpected attribute 'valeu' in <float>: 'value' is known"},
        {"<shape type='sphere'><float name='raduis' value='2'/></shape>",
         "unknown parameter 'raduis' of shape 'sphere': 'radius' is known"},
        {"<shape type='cube'><bsdf type='diffuse'><rgb name='refelctance' value='0.5'/></bsdf></shape>",
         "unknown parameter 'refelctance' of bsdf 'diffuse': 'reflectance' is known"},
        {"<shape type='cube'><transform name='toworld'><scale value='2'/></transform></shape>",
         "unknown parameter 'toworld' of shape 'cube': 'to_world' is known"},
        {"<shape type='cube'><transform name='to_world'><scle value='2'/></transform></shape>",
         "unknown element <scle> in <transform>: 'scale' is known"},
        {"<bsdf type='diffuse' id='Red'/><shape type='cube'><ref id='red'/></shape>",
         "reference to unknown id 'red': 'Red' is known"},
        {"<shape type='rectangle'><float name='a' value='1'/><float name='a' value='1'/></shape>",
         "parameter 'a' is given twice"},
        {"<shape type='rectangle'><boolean name='flip_normals' value='maybe'/></shape>",
         "'maybe' is neither true nor false"},
        {"<shape type='rectangle'><float name='flip_normals' value='1'/></shape>",
         "parameter 'flip_normals' of rectangle must be a boolean"},
        {"<shape type='instance'/>", "instance has no shapegroup"},
    };
    for (const auto& [body, expected] : cases) {
        INFO(body);
        const std::string message = error_of(body, {}, "3.0.0", &folder);
        INFO(message);
        CHECK(contains(message, expected));
    }
    const std::string longest(300000, 'a');
    const std::string ids =
        "<bsdf type='diffuse' id='" + longest + "b'/><shape type='cube'><ref id='" + longest + "'/></shape>";
    CHECK(error_of(ids, {}, "3.0.0", &folder).ends_with("reference to unknown id '" + longest + "'"));
    CHECK_THROWS_AS(load_mitsuba("/nonexistent/scene.xml"), Error);
    const std::string empty = folder.write("empty.xml", "<scene version='3.0.0'/>");
    CHECK_THROWS_WITH(load_mitsuba(empty), empty + ": the scene has no sensor");
    CHECK_THROWS_WITH(load_scene_file(std::string(300, 'a'), {}), std::string(300, 'a') + ": File name too long");
}

TEST_CASE("lenient loading lists each substitution once") {
    LoadOptions lenient;
    lenient.lenient = true;
    const Scene s = load(
        "<integrator type='depth'/>\n"
        "<sensor type='perspective'><film type='hdrfilm'><rfilter type='sharp'/></film></sensor>\n"
        "<bsdf type='measured' id='p'><float name='roughness' value='1'/></bsdf>\n"
        "<shape type='rectangle'><ref id='p'/></shape>\n<shape type='rectangle'><ref id='p'/></shape>\n"
        "<shape type='ellipsoids'/>\n<emitter type='lantern'/>\n<shape type='rectangle'><float name='odd' "
        "value='1'/></shape>",
        lenient);
    CHECK(s.shapes.size() == 3);
    CHECK(s.sensor.filter == FilterType::gaussian);
    CHECK(s.integrator.type == "path");
    const char* expected[] = {":3: reconstruction filter 'sharp' is not supported; gaussian is used",
                              ":2: integrator type 'depth' is not supported; path is used",
                              ":8: emitter type 'lantern'",
                              ":4: BSDF type 'measured' is not supported",
                              ":7: shape type 'ellipsoids'",
                              ":9: unknown parameter 'odd' of shape 'rectangle'; it is ignored"};
    for (const char* part : expected) {
        INFO(part);
        CHECK(std::count_if(s.warnings.begin(), s.warnings.end(),
                            [&](const std::string& w) { return contains(w, part); }) == 1);
    }
    CHECK(s.warnings.size() == std::size(expected));
    // Mistakes stay mistakes.
    CHECK(contains(error_of("<shape type='rectangle'><ref id='nobody'/></shape>", lenient), "unknown id"));
}
