// libs: ambilux_formats ambilux_accel
// timeout: 120
// What files of forks, other programs and Mitsuba's own tests hold that no manual names.
#include <cmath>

#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("integrators of other programs are the path tracer, with their path lengths") {
    const std::string guided =
        "<integrator type='guided_path'><integer name='max_depth' value='7'/><integer name='rr_depth' value='4'/>"
        "<float name='budget' value='300'/></integrator>";
    const Scene s = load_quietly(
        "<integrator type='guided_path'><integer name='max_depth' value='7'/>"
        "<boolean name='hide_emitters' value='true'/></integrator>");
    CHECK(s.integrator.type == "path");
    CHECK(s.integrator.max_depth == 7);
    CHECK(s.integrator.hide_emitters);
    CHECK(has_note(s, "integrator 'guided_path' is not known; path, with its max_depth, is used"));
    CHECK(load(guided, {}, "0.6.0").integrator.max_depth == 7);
    const Scene nested = load_quietly("<integrator type='wrapper'><integrator type='direct'/></integrator>");
    CHECK(nested.integrator.max_depth == 2);
    CHECK(has_note(nested, "the one inside of it is used"));
    for (const char* type : {"depth", "stokes", "field", "ao"})
        CHECK(contains(error_of("<integrator type='" + std::string(type) + "'/>"), "is not supported"));
}

TEST_CASE("what a plugin does not know is left out with a note in the older generation, and refused in the newer") {
    const std::string body =
        "<shape type='rectangle'><bsdf type='dielectric'><float name='alpha' value='0.1'/></bsdf></shape>";
    const Scene old = load_quietly(body, "0.6.0");
    CHECK(has_note(old, "parameter 'alpha' of bsdf 'dielectric' is not known and left out, as Mitsuba 0.6 does"));
    CHECK(contains(error_of(body), "unknown parameter 'alpha' of bsdf 'dielectric'"));
    const std::string root = "<integer name='maxDepth' value='3'/>";
    CHECK(has_note(load_quietly(root, "0.5.0"), "parameter 'max_depth' of scene is not known"));
    CHECK(
        contains(error_of("<shape type='rectangle'><phase type='hg'/></shape>", {}, "0.6.0"), "not supported: phase"));
}

TEST_CASE("of a parameter that is given twice the last one counts in the older generation") {
    const std::string body =
        "<shape type='sphere'><float name='radius' value='2'/><float name='radius' value='3'/></shape>";
    const Scene s = load_quietly(body, "0.5.0");
    CHECK(s.quadrics[0].radius == 3);
    CHECK(has_note(s, "parameter 'radius' is given twice; the last one counts"));
    CHECK(contains(error_of(body), "parameter 'radius' is given twice"));
}

TEST_CASE("marks for manifold sampling change nothing") {
    const Scene s = load_quietly("<shape type='sphere'><boolean name='caustic_caster_multi' value='true'/></shape>");
    CHECK(has_note(s, "parameter 'caustic_caster_multi' of shape 'sphere' is not known and left out"));
}

TEST_CASE("numbers may end in f; a number may be given as a colour or as a spectrum of one value") {
    const Scene s = load_quietly(
        "<shape type='sphere'><float name='radius' value='2.5f'/><bsdf type='principled'>"
        "<rgb name='roughness' value='0.1, 0.4, 0.7f'/><spectrum name='metallic' value='0.25'/></bsdf></shape>");
    CHECK(s.quadrics[0].radius == 2.5f);
    const auto p = parameters<Principled>(s.bsdfs[s.materials[s.shapes[0].material].front]);
    CHECK(p.roughness.value == Approx(0.4));
    CHECK(p.metallic.value == Approx(0.25));
    CHECK(contains(error_of("<shape type='sphere'><float name='radius' value='2.5g'/></shape>"), "is not a number"));
    CHECK(contains(error_of("<shape type='sphere'><float name='radius' value='f'/></shape>"), "is not a number"));
    CHECK(contains(error_of("<shape type='sphere'><float name='radius' value='2ff'/></shape>"), "is not a number"));
}

TEST_CASE("a texture may stand in an element spectrum") {
    const std::string checkerboard =
        "<spectrum name='reflectance' type='checkerboard'><rgb name='color0' value='0.1, 0.2, 0.3'/></spectrum>";
    const Scene s = load_quietly("<shape type='rectangle'><bsdf type='diffuse'>" + checkerboard + "</bsdf></shape>");
    check_rgb(reflectance(s, 0, {0.1f, 0.1f}), {0.1f, 0.2f, 0.3f});
    CHECK(contains(error_of("<shape type='rectangle'><bsdf type='diffuse'><spectrum name='reflectance' type='x'/>"
                            "</bsdf></shape>"),
                   "spectrum type 'x' is not supported"));
}

TEST_CASE("of a batch of sensors the first one, with its part of the film") {
    const std::string inner =
        "<sensor type='perspective'><float name='fov' value='40'/><film type='hdrfilm'>"
        "<integer name='width' value='7'/></film></sensor>";
    const auto batch = [&](const char* width, const std::string& inside) {
        return "<sensor type='batch'>" + inside + "<film type='hdrfilm'><integer name='width' value='" + width +
               "'/><integer name='height' value='20'/></film><sampler type='independent'><integer "
               "name='sample_count' value='9'/></sampler></sensor>";
    };
    const Scene s = load_quietly(batch("60", inner + inner + inner));
    CHECK(s.sensor.film_width == 20);
    CHECK(s.sensor.film_height == 20);
    CHECK(s.sensor.tan_half_fov.x == Approx(std::tan(20 * M_PI / 180)));
    CHECK(s.integrator.spp == 9);
    CHECK(has_note(s, "of a batch of sensors the first one is used"));
    CHECK(contains(error_of(batch("61", inner + inner)), "is no multiple of the 2 sensors"));
    CHECK(contains(error_of(batch("60", "")), "the batch has no sensor inside"));
}

TEST_CASE("a scene without a sensor is seen along +z, all of it") {
    const TempFolder folder;
    const auto load_without = [&](const std::string& body) {
        return load_mitsuba(folder.write("scene.xml", wrap(body, "3.0.0")), {});
    };
    const Scene s = load_without(
        "<shape type='sphere'><point name='center' x='1' y='2' z='3'/><float name='radius' value='2'/></shape>");
    const double distance = 4 / (2 * std::tan(M_PI / 8));
    CHECK(s.sensor.to_world.m[0][3] == Approx(1));
    CHECK(s.sensor.to_world.m[1][3] == Approx(2));
    CHECK(s.sensor.to_world.m[2][3] == Approx(1 - distance));
    CHECK(s.sensor.to_world.m[2][2] == 1);
    CHECK(s.sensor.tan_half_fov.x == Approx(std::tan(M_PI / 8)));
    CHECK(s.sensor.near_clip == Approx(distance / 100));
    CHECK(s.sensor.film_width == 768);
    CHECK(has_note(s, "the scene has no sensor"));
    // Far from the origin it is placed after the scene was moved.
    const Scene far = load_without("<shape type='sphere'><point name='center' x='1e6' y='0' z='0'/></shape>");
    CHECK(double(far.sensor.to_world.m[0][3]) + far.origin[0] == Approx(1e6));
    CHECK(std::fabs(far.sensor.to_world.m[0][3]) < 1);
}

TEST_CASE("an area emitter beside the shape that refers to it") {
    const std::string light = "<emitter type='area' id='light'><rgb name='radiance' value='1, 2, 3'/></emitter>";
    const Scene s = load_quietly(light + "<shape type='rectangle'><ref id='light'/></shape>");
    REQUIRE(s.emitters.size() == 1);
    check_rgb(s.emitters[0].radiance.value, {1, 2, 3});
    CHECK(contains(error_of(light), "emitter type 'area' is not supported"));
}

TEST_CASE("principled: a tint of the part that is not transmitted") {
    const auto body = [](const char* tint) {
        return "<shape type='sphere'><bsdf type='principled'><float name='spec_trans' value='0.4'/>"
               "<float name='spec_tint' value='" +
               std::string(tint) + "'/></bsdf></shape>";
    };
    const Scene s = load_quietly(body("0.3"));
    // Mitsuba tints 0.3 of all; 0.4 of it is glass here, which has no tint: the rest has 0.3/0.6.
    bool found = false;
    for (const BsdfRecord& record : s.bsdfs)
        if (record.type == kBsdfType<Principled>) found = record.as<Principled>().specular_tint == Approx(0.5);
    CHECK(found);
    CHECK(contains(error_of(body("0.7")), "spec_tint and spec_trans may be 1 together at most"));
}

TEST_CASE("obj files of the older generation: materials are noted, single parts refused") {
    const TempFolder folder;
    const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    folder.write("plain.obj", triangle);
    folder.write("rich.obj", "mtllib rich.mtl\nusemtl red\n" + triangle);
    const auto shape = [](const std::string& file, const std::string& more) {
        return "<shape type='obj'><string name='filename' value='" + file + "'/>" + more + "</shape>";
    };
    const char* note = "materials of obj files are not read";
    CHECK(has_note(load_quietly(shape("rich.obj", ""), "0.6.0", &folder), note));
    CHECK_FALSE(has_note(load_quietly(shape("plain.obj", ""), "0.6.0", &folder), note));
    CHECK_FALSE(has_note(load_quietly(shape("rich.obj", ""), "3.0.0", &folder), note));
    CHECK_FALSE(has_note(load_quietly(shape("rich.obj", "<bsdf type='diffuse'/>"), "0.6.0", &folder), note));
    CHECK_FALSE(has_note(
        load_quietly(shape("rich.obj", "<boolean name='loadMaterials' value='false'/>"), "0.6.0", &folder), note));
    CHECK(contains(error_of(shape("rich.obj", "<integer name='shapeIndex' value='1'/>"), {}, "0.6.0", &folder),
                   "a single part of an obj file is not supported"));
}
