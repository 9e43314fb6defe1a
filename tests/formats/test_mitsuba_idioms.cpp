// libs: ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 120
// What scene collections and exporters write: each idiom loads, with the image that the file asks for, and what is done
// in another way than the file says is noted.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/math.h"
#include "formats/meshes/mesh.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "transport/emitter.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

const std::string kLight = "<emitter type='constant'/>";

std::string film(const std::string& xml) { return "<sensor type='perspective'>" + xml + "</sensor>"; }

std::string textured(const std::string& texture) {
    return "<shape type='rectangle'><bsdf type='diffuse'>" + texture + "</bsdf></shape>";
}

}  // namespace

TEST_CASE("of files of one name the folders of <path> come first, then that of the scene, then that of the include") {
    const TempFolder folder;
    const std::string part = wrap("<shape type='obj'><string name='filename' value='m.obj'/></shape>", "3.0.0");
    const auto square = [&](const std::string& in, int size) {
        const std::string s = std::to_string(size);
        folder.write(in + "m.obj", "v 0 0 0\nv " + s + " 0 0\nv 0 " + s + " 0\nf 1 2 3\n");
    };
    folder.write("sub/part.xml", part);
    square("sub/", 3);
    const auto size = [&](const std::string& body) {
        const Scene s = load(body, {}, "3.0.0", &folder);
        CHECK(has_note(s, "part.xml:2: 'm.obj' is ") ==
              (contains(body, "include") && s.vertices[1].p.x != 3));  // the other one lies beside the include
        return s.vertices[1].p.x;
    };
    const std::string include = "<include filename='sub/part.xml'/>",
                      shape = "<shape type='obj'><string name='filename' value='m.obj'/></shape>";
    CHECK(size(include) == 3);  // the only one
    square("", 1);
    CHECK(size(include) == 1);
    CHECK(size(shape) == 1);
    square("a/", 4);
    square("b/", 5);
    CHECK(size("<path value='a'/>" + shape) == 4);
    CHECK(size("<path value='a'/><path value='b'/>" + shape) == 5);
    CHECK(size("<path value='a'/>" + include) == 4);
    // A <path> of an included file lies beside it, if there is such a folder.
    square("sub/a/", 6);
    folder.write("sub/part.xml", wrap("<path value='a'/>" + shape, "3.0.0"));
    CHECK(load(include, {}, "3.0.0", &folder).vertices[1].p.x == 6);
}

TEST_CASE("films: all kinds get linear values, with a note") {
    for (const char* type : {"ldrfilm", "tiledhdrfilm", "mfilm"}) {
        const Scene s = load_quietly(film("<film type='" + std::string(type) +
                                          "'><integer name='width' value='64'/><integer name='height' value='32'/>"
                                          "<float name='gamma' value='2.2'/><boolean name='banner' value='false'/>"
                                          "<string name='fileFormat' value='png'/><rfilter type='box'/></film>"),
                                     "0.6.0");
        CHECK(s.sensor.film_width == 64);
        CHECK(s.sensor.filter == FilterType::box);
        CHECK(has_note(s, "a film of type '" + std::string(type) + "' gets linear values"));
    }
    CHECK(contains(error_of(film("<film type='specfilm'/>")), "film type 'specfilm' is not supported"));
    // One of another program.
    const Scene s =
        load_quietly(film("<film type='time_film'><integer name='width' value='64'/>"
                          "<integer name='bins' value='9'/><rfilter type='box'/></film>"));
    CHECK(s.sensor.film_width == 64);
    CHECK(s.sensor.filter == FilterType::box);
    CHECK(has_note(s, "film type 'time_film' is not known; it is read as hdrfilm"));
}

TEST_CASE("labels of films of 0.6 name what is known after rendering, which is no parameter") {
    const std::string label =
        "<film type='hdrfilm'><string name=\"metadata['time']\" value=\"$scene['time']\"/>"
        "<integer name='width' value='64'/></film>";
    CHECK(has_note(load_quietly(film(label), "0.6.0"), "parameter 'metadata['time']' of film 'hdrfilm' is not known"));
    CHECK(contains(error_of(film("<film type='hdrfilm'><integer name='width' value='$scene'/></film>")),
                   "parameter '$scene' has no value"));
}

TEST_CASE("a medium that nothing refers to is left out, with a note") {
    CHECK(
        has_note(load_quietly("<medium type='homogeneous' id='m'><float name='scale' value='0.1'/></medium>" + kLight),
                 "media are not supported; this one is left out"));
}

TEST_CASE("filters with negative lobes become a gaussian, samplers independent, with a note") {
    for (const char* type : {"mitchell", "catmullrom", "lanczos"}) {
        const Scene s = load_quietly(film("<film type='hdrfilm'><rfilter type='" + std::string(type) + "'/></film>"));
        CHECK(s.sensor.filter == FilterType::gaussian);
        CHECK(s.sensor.filter_radius == 2);
        CHECK(has_note(s, "has negative lobes"));
    }
    const Scene s =
        load_quietly(film("<sampler type='blue'><integer name='sample_count' value='9'/><float "
                          "name='radius' value='1'/></sampler>"));
    CHECK(s.integrator.spp == 9);
    CHECK(has_note(s, "sampler type 'blue' is not known"));
}

TEST_CASE("integrators of the same equation are the path tracer") {
    for (const char* type : {"volpath", "volpath_simple", "volpathmis", "pssmlt", "mlt", "erpt", "photonmapper", "ppm",
                             "sppm", "vpl", "prb"}) {
        const Scene s = load_quietly("<integrator type='" + std::string(type) +
                                         "'><integer name='maxDepth' value='7'/><integer name='workUnits' value='3'/>"
                                         "</integrator>",
                                     "0.5.0");
        CHECK(s.integrator.type == "path");
        CHECK(s.integrator.max_depth == 7);
        CHECK(has_note(s, "converges to the image of the path tracer"));
    }
    for (const char* type : {"aov", "multichannel", "adaptive", "irrcache"}) {
        const Scene s = load_quietly("<integrator type='" + std::string(type) +
                                     "'><string name='aovs' value='dd:depth'/><integrator type='path'><integer "
                                     "name='max_depth' value='5'/></integrator></integrator>");
        CHECK(s.integrator.max_depth == 5);
    }
    CHECK(load_quietly("<integrator type='ptracer'/>").integrator.type == "light");
    // Bitterli's files ask for what is always so.
    load_quietly(
        "<integrator type='path'><integer name='maxDepth' value='65'/><boolean name='strictNormals' "
        "value='true'/></integrator>",
        "0.5.0");
    CHECK(contains(error_of("<integrator type='aov'/>"), "aov has no nested integrator"));
}

TEST_CASE("hide_emitters before lamps: a note in formats whose rays pass them") {
    const std::string hides = "<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>",
                      lamp = "<shape type='sphere'><emitter type='area'/></shape>",
                      note = "hide_emitters hides the light";
    CHECK(has_note(load(hides + lamp), note));
    CHECK(!has_note(load(hides + kLight), note));
    CHECK(!has_note(load(lamp), note));
    CHECK(!has_note(load(hides + lamp, {}, "0.6.0"), note));
}

TEST_CASE("several sensors: the first one") {
    const Scene s = load_quietly(
        "<sensor type='perspective'/><sensor type='thinlens'/><film type='hdrfilm' id='f'/>"
        "<sampler type='independent' id='s'/>");
    CHECK(s.sensor.type == SensorType::perspective);
    CHECK(has_note(s, "the first of several sensors"));
}

TEST_CASE("format 0.3 and 0.5: old names of elements, attributes for intent, lookAt without up") {
    const Scene s = load_quietly(
        "<camera type='perspective'><transform name='toWorld'><lookAt origin='0,0,5' target='0,0,0'/></transform>"
        "</camera><luminaire type='point'><spectrum name='intensity' value='3' intent='illuminant'/></luminaire>"
        "<sensor type='perspective'/>",
        "0.3.0");
    REQUIRE(s.emitters.size() == 1);
    check_rgb(s.emitters[0].radiance.value, splat(3));
    CHECK(s.sensor.to_world.m[2][3] == 5);
    CHECK(s.sensor.to_world.m[2][2] == -1);
}

TEST_CASE("spectra that are objects, and black bodies") {
    const auto intensity = [](const std::string& xml, const std::string& version = "3.0.0") {
        return load_quietly("<emitter type='point'>" + xml + "</emitter>", version).emitters[0].radiance.value;
    };
    check_rgb(intensity("<spectrum name='intensity' type='d65'><float name='scale' value='4'/></spectrum>"), splat(4));
    check_rgb(intensity("<spectrum name='intensity' type='uniform'><float name='value' value='2'/></spectrum>"),
              splat(2));
    check_rgb(
        intensity("<spectrum name='intensity' type='rawconstant'><vector name='value' value='1,2,3'/></spectrum>"),
        {1, 2, 3});
    const Rgb list = intensity("<spectrum name='intensity' value='400:1, 500:3, 700:2'/>");
    check_rgb(intensity("<spectrum name='intensity' type='irregular'><string name='wavelengths' value='400,500,700'/>"
                        "<string name='values' value='1,3,2'/></spectrum>"),
              list);
    check_rgb(intensity("<spectrum name='intensity' type='regular'><float name='wavelength_min' value='400'/><float "
                        "name='wavelength_max' value='600'/><string name='values' value='1 3 2'/></spectrum>"),
              intensity("<spectrum name='intensity' value='400:1, 500:3, 600:2'/>"));
    // At 6500 K a black body is nearly white; that of format 3 and that of 0.6 are one.
    const Rgb hot = intensity("<blackbody name='intensity' temperature='6500K' scale='2'/>", "0.6.0");
    CHECK(hot.x / hot.z == Approx(1).margin(0.1));
    check_rgb(hot / hot.y, intensity("<spectrum name='intensity' type='blackbody'><float name='temperature' "
                                     "value='6500'/></spectrum>") *
                               (2 / hot.y));
    CHECK(contains(error_of("<emitter type='point'><spectrum name='intensity' type='led'/></emitter>"),
                   ":2: spectrum type 'led' is not supported"));
    CHECK(contains(error_of("<emitter type='point'><spectrum name='intensity' type='d65'><float name='k' "
                            "value='1'/></spectrum></emitter>"),
                   "unknown parameter 'k' of a spectrum"));
}

TEST_CASE("textures of 0.6: one scale for both coordinates, which are uv; a scaled texture at the top") {
    const auto checkers = [](const std::string& xml) {
        return load_quietly(textured("<texture name='reflectance' type='checkerboard'>" + xml + "</texture>") + kLight,
                            "0.6.0")
            .textures.at(0);
    };
    const Texture t = checkers(
        "<float name='uvscale' value='10'/><float name='vscale' value='3'/>"
        "<string name='coordinates' value='uv'/>");
    CHECK(t.to_uv[0][0] == 10);
    CHECK(t.to_uv[1][1] == 3);
    CHECK(contains(error_of(textured("<texture name='reflectance' type='checkerboard'><string name='coordinates' "
                                     "value='local'/></texture>"),
                            {}, "0.6.0"),
                   "textures have coordinates uv only"));
    const Scene s = load_quietly(
        "<texture type='checkerboard' id='c'/><texture type='scale' id='half'><float name='scale' value='0.5'/><ref "
        "id='c'/></texture>" +
            textured("<ref name='reflectance' id='half'/>"),
        "0.6.0");
    check_rgb(reflectance(s, 0, {0.1f, 0.1f}), splat(0.2f));
    CHECK(contains(error_of("<texture type='scale' id='none'/>"), "has no nested texture"));
}

TEST_CASE("envmap of 0.6: gamma of its image") {
    const TempFolder folder;
    folder.write("sky.png", png_bytes(2, 2, std::vector<uint8_t>(12, 128)));
    const auto radiance = [&](const std::string& gamma) {
        const Scene s =
            load_quietly("<emitter type='envmap'><string name='filename' value='sky.png'/>" + gamma + "</emitter>",
                         "0.6.0", &folder);
        return environment_radiance<kAllFeatures>(s.view(), {0, 0, 1}).x;
    };
    CHECK(radiance("") == Approx(0.2158605).epsilon(1e-3));
    CHECK(radiance("<float name='gamma' value='-1'/>") == Approx(0.2158605).epsilon(1e-3));
    CHECK(radiance("<float name='gamma' value='1'/>") == Approx(128 / 255.0).epsilon(1e-3));
    CHECK(contains(error_of("<emitter type='envmap'><string name='filename' value='sky.png'/><float name='gamma' "
                            "value='1'/></emitter>",
                            {}, "3.0.0", &folder),
                   "unknown parameter 'gamma'"));
}

TEST_CASE("vertex colours of 0.6 are sRGB unless the shape says otherwise") {
    const TempFolder folder;
    folder.write("v.ply",
                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                 "property float r\nproperty float g\nproperty float b\nelement face 1\nproperty list uchar int "
                 "vertex_indices\nend_header\n0 0 0 .5 .5 .5\n1 0 0 .5 .5 .5\n0 1 0 .5 .5 .5\n3 0 1 2\n");
    const auto seen = [&](const std::string& more, const std::string& texture, const std::string& version) {
        const Scene s = load_quietly("<shape type='ply'><string name='filename' value='v.ply'/>" + more +
                                         "<bsdf type='diffuse'>" + texture + "</bsdf></shape>",
                                     version, &folder);
        return reflectance(s, 0, {0.3f, 0.3f}).x;
    };
    const std::string old = "<texture name='reflectance' type='vertexcolors'/>";
    CHECK(seen("", old, "0.6.0") == Approx(0.2140411).epsilon(1e-4));
    CHECK(seen("<boolean name='srgb' value='false'/>", old, "0.6.0") == Approx(0.5).epsilon(1e-4));
    CHECK(seen("<boolean name='srgb' value='true'/>", "", "0.6.0") == 0.5f);
    CHECK(seen("",
               "<texture name='reflectance' type='mesh_attribute'><string name='name' value='vertex_color'/></texture>",
               "3.0.0") == Approx(0.5).epsilon(1e-4));
}

TEST_CASE("names of files as Windows writes them; opacities that are colours") {
    const TempFolder folder;
    std::filesystem::create_directory(folder / "textures");
    folder.write("textures/i.png", png_bytes(1, 1, {255, 0, 128}));
    load_quietly(textured("<texture name='reflectance' type='bitmap'><string name='filename' "
                          "value='textures\\i.png'/></texture>"),
                 "0.6.0", &folder);
    CHECK(contains(error_of(textured("<texture name='reflectance' type='bitmap'><string name='filename' "
                                     "value='textures\\j.png'/></texture>"),
                            {}, "0.6.0", &folder),
                   "does not exist"));
    const auto mask = [](const char* opacity) {
        return "<shape type='rectangle'><bsdf type='mask'><rgb name='opacity' value='" + std::string(opacity) +
               "'/><bsdf type='diffuse'/></bsdf></shape>";
    };
    const Scene grey = load_quietly(mask("0.4"));
    CHECK(grey.materials[grey.shapes[0].material].opacity.value == Approx(0.4));
    CHECK(contains(error_of(mask("0.3, 0.5, 0.7")), ":2: a mask of a coloured opacity is not supported"));
}

TEST_CASE("textures: scale, rawconstant, gridtexture, channel") {
    const TempFolder folder;
    folder.write("i.png", png_bytes(1, 1, {255, 0, 128}));
    const std::string image = "<string name='filename' value='i.png'/>";
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='scale'><rgb name='scale' value='"
                                                "0.5,1,0.25'/><texture type='scale'><float name='scale' value='0.5'/>"
                                                "<texture type='bitmap'>" +
                                                image + "</texture></texture></texture>"),
                                       "0.6.0", &folder),
                          0, {0.5f, 0.5f}),
              {0.25f, 0, 0.125f * 0.2158605f});
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='bitmap'><string name='channel' "
                                                "value='r'/>" +
                                                image + "</texture>"),
                                       "0.6.0", &folder),
                          0, {0.5f, 0.5f}),
              splat(1));
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='bitmap'><string name='channel' "
                                                "value='a'/>" +
                                                image + "</texture>"),
                                       "0.6.0", &folder),
                          0, {0.5f, 0.5f}),
              splat(1));
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='rawconstant'><rgb name='value' "
                                                "value='0.1,0.2,0.3'/></texture>")),
                          0, {0.3f, 0.6f}),
              {0.1f, 0.2f, 0.3f});
    const Scene grid = load_quietly(textured("<texture name='reflectance' type='gridtexture'><float name='lineWidth' "
                                             "value='0.05'/><float name='uscale' value='2'/></texture>"),
                                    "0.6.0");
    for (const auto& [u, expected] : {std::pair{0.02f, 0.4f}, {0.03f, 0.2f}, {0.47f, 0.2f}, {0.48f, 0.4f}})
        check_rgb(reflectance(grid, 0, {u, 0.5f}), splat(expected));
    check_rgb(reflectance(grid, 0, {0.25f, 0.96f}), splat(0.4f));
    CHECK(contains(error_of(textured("<texture name='reflectance' type='scale'/>")), "has no nested texture"));
}

TEST_CASE("checkerboards of numbers have their colours exchanged in format 3") {
    const std::string mask =
        "<shape type='rectangle'><bsdf type='mask'><texture name='opacity' type='checkerboard'><rgb "
        "name='color0' value='1'/><rgb name='color1' value='0'/></texture><bsdf type='diffuse'/>"
        "</bsdf></shape>";
    const auto opacity = [](const Scene& s) {
        return eval_float<kAllFeatures>(s.view(), s.materials[s.shapes[0].material].opacity, {0.25f, 0.25f});
    };
    const Scene newer = load_quietly(mask);
    CHECK(opacity(newer) == 0);
    CHECK(has_note(newer, "colours exchanged"));
    CHECK(opacity(load_quietly(mask, "0.6.0")) == 1);
}

TEST_CASE("bump and normal maps: rules of Mitsuba 3.7 are on in format 3 unless the file says otherwise") {
    const auto rules = [](const std::string& xml, const std::string& version) {
        const Scene s = load_quietly("<shape type='rectangle'><bsdf type='bumpmap'>" + xml +
                                         "<texture type='checkerboard'/><bsdf type='diffuse'/></bsdf></shape>" + kLight,
                                     version);
        CHECK(s.notes.empty());
        CHECK(s.features.map_rules == (s.bsdfs[0].map_rules != 0));
        return s.bsdfs[0].map_rules;
    };
    const auto flag = [](const std::string& name, const std::string& value) {
        return "<boolean name='" + name + "' value='" + value + "'/>";
    };
    const std::string turn = "flip_invalid_normals", shadow = "use_shadowing_function";
    CHECK(rules("", "3.0.0") == (kTurnNormals | kShadowBumps));
    CHECK(rules("", "2.1.0") == (kTurnNormals | kShadowBumps));
    CHECK(rules("", "0.6.0") == 0);
    CHECK(rules(flag(turn, "false"), "3.0.0") == kShadowBumps);
    CHECK(rules(flag(shadow, "false"), "3.0.0") == kTurnNormals);
    CHECK(rules(flag(turn, "true"), "0.6.0") == kTurnNormals);
}

TEST_CASE("a spectrum that is the same everywhere is no white as a light in format 3, and grey as a reflectance") {
    const auto light = [](const std::string& value, const std::string& version) {
        return load_quietly("<emitter type='constant'>" + value + "</emitter>", version).emitters[0].radiance.value;
    };
    const std::string two = "<spectrum name='radiance' value='2'/>";
    check_rgb(light(two, "3.0.0"), {2.40958f, 1.89658f, 1.81783f}, 1e-4);  // from Mitsuba 3.9
    check_rgb(light(two, "0.6.0"), splat(2));
    check_rgb(light("<spectrum name='radiance' type='d65'/>", "3.0.0"), splat(1));
    check_rgb(light("<float name='radiance' value='2'/>", "3.0.0"), splat(2));
    const Scene s = load_quietly(
        "<shape type='rectangle'><bsdf type='diffuse'><spectrum name='reflectance' "
        "value='0.5'/></bsdf></shape>");
    check_rgb(reflectance(s, 0, {0, 0}), splat(0.5f));
}

TEST_CASE("what stands behind the end of the scene is not left out silently") {
    CHECK(contains(error_of("</scene><scene version='3.0.0'>"), "behind the end of the scene"));
}

TEST_CASE("null is a surface that rays do not see, unless it emits") {
    const Scene s = load_quietly(
        "<shape type='sphere'><bsdf type='null'/></shape><shape type='rectangle'><bsdf "
        "type='null'/><emitter type='area'/></shape>");
    CHECK(s.materials[s.shapes[0].material].opacity.value == 0);
    const Material& pane = s.materials[s.shapes[1].material];
    CHECK(pane.opacity.value == 1);
    CHECK(s.bsdfs[pane.front].type == BsdfType::thin_dielectric);
    CHECK(s.bsdfs[pane.front].as<ThinDielectric>().ior == 1);
}

TEST_CASE("merge holds shapes; sampling weights are noted") {
    const Scene s = load_quietly(
        "<shape type='merge'><shape type='cube'/><shape type='rectangle'/></shape>\n"
        "<emitter type='point'><float name='sampling_weight' value='2'/></emitter>");
    CHECK(s.shapes.size() == 2);
    CHECK(has_note(s, "sampling weights of emitters"));
    CHECK(contains(error_of("<emitter type='point'><float name='sampling_weight' value='0'/></emitter>"),
                   "a sampling weight of 0"));
}

TEST_CASE("maxSmoothAngle divides vertices at sharp edges only") {
    // A roof of two slopes with 60 degrees between their normals.
    const TempFolder folder;
    const float c = std::cos(30 * kPi / 180), h = std::sin(30 * kPi / 180);
    std::string obj;
    for (const Vec3f p : {Vec3f{-c, -1, -h}, {-c, 1, -h}, {0, -1, 0}, {0, 1, 0}, {c, -1, -h}, {c, 1, -h}})
        obj += "v " + std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + "\n";
    folder.write("roof.obj", obj + "f 1 3 4 2\nf 3 5 6 4\n");
    const auto shape = [&](const char* angle) {
        return load_quietly(
            "<shape type='obj'><string name='filename' value='roof.obj'/><float name='maxSmoothAngle' "
            "value='" +
                std::string(angle) + "'/></shape>",
            "0.6.0", &folder);
    };
    const Scene sharp = shape("50"), smooth = shape("70");
    CHECK(sharp.vertices.size() == 8);
    CHECK(smooth.vertices.size() == 6);
    for (const MeshVertex& v : sharp.vertices) CHECK(std::fabs(v.n.x) == Approx(0.5).margin(1e-4));
    for (const MeshVertex& v : smooth.vertices)
        if (std::fabs(v.p.x) < 0.1f) CHECK(v.n.z == Approx(1).margin(1e-4));
    Mesh fan;
    for (uint32_t i = 0; i < 5000; ++i) {
        const float a = float(i) * 1e-3f;
        fan.positions.insert(fan.positions.end(), {{0, 0, 0}, {std::cos(a), std::sin(a), 0}, {0, 0, float(i + 1)}});
        fan.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    CHECK_THROWS_AS(split_at_edges("fan.obj", fan, 10), Error);
}
