// libs: ambilux_formats ambilux_accel
// timeout: 60
// Shares that are above 1: rounded ones count as 1, others are told with their file and value, or clipped as the format
// has it.
#include <cstring>

#include "tests/support/gltf_text.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// A map of floats with one texel.
std::string pfm(float r, float g, float b) {
    const float values[] = {r, g, b};
    return "PF\n1 1\n-1.0\n" + std::string(reinterpret_cast<const char*>(values), sizeof values);
}

const std::string kHead =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "property float r\nproperty float g\nproperty float b\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n";

std::string textured(const std::string& name, const std::string& inside, const std::string& bsdf = "diffuse",
                     const std::string& slot = "reflectance") {
    return "<shape type='rectangle'><bsdf type='" + bsdf + "'><texture type='" + name + "' name='" + slot + "'>" +
           inside + "</texture></bsdf></shape>";
}

const std::string kBright = "<string name='filename' value='bright.pfm'/>";

bool warns(const Scene& s, const std::string& part) {
    return s.warnings.size() == 1 && contains(s.warnings[0], part) && contains(s.warnings[0], "creates energy");
}

}  // namespace

TEST_CASE("numbers that are rounded to just above 1 are 1") {
    const Scene s = load_quietly(
        "<shape type='rectangle'><bsdf type='diffuse'><rgb name='reflectance' "
        "value='1.00000012, 0.5, 1.0004'/></bsdf></shape>");
    CHECK(reflectance(s, 0, {0, 0}) == Rgb{1, 0.5f, 1});
    const auto inside = [](const std::string& type, const std::string& name, const std::string& rest) {
        return load_quietly("<shape type='rectangle'><bsdf type='" + type + "'><float name='" + name +
                            "' value='1.0000001'/>" + rest + "</bsdf></shape>");
    };
    CHECK(inside("mask", "opacity", "<bsdf type='diffuse'/>").materials[0].opacity.value == 1);
    CHECK(inside("principled", "metallic", "").bsdfs[0].as<Principled>().metallic.value == 1);
    inside("blendbsdf", "weight", "<bsdf type='diffuse'/><bsdf type='plastic'/>");
    load_quietly(
        "<shape type='rectangle'><bsdf type='mixturebsdf'><string name='weights' value='0.7, 0.3001'/>"
        "<bsdf type='diffuse'/><bsdf type='plastic'/></bsdf></shape>");
    CHECK(contains(error_of("<shape type='rectangle'><bsdf type='diffuse'><rgb name='reflectance' value='1.2'/>"
                            "</bsdf></shape>"),
                   "larger than 1"));
}

TEST_CASE("what reflects more than 1 warns once with its file and its largest value") {
    const TempFolder folder;
    folder.write("bright.pfm", pfm(0.5f, 1.5f, 0.25f));
    folder.write("rounded.pfm", pfm(1.0009766f, 1, 1));
    const auto loaded = [&](const std::string& body) { return load(body, {}, "3.0.0", &folder); };
    const Scene s = loaded(textured("bitmap", kBright) + textured("bitmap", kBright));
    CHECK(warns(s, "'reflectance' is up to 1.5, by " + (folder.path / "bright.pfm").string()));
    CHECK(reflectance(s, 0, {0.5f, 0.5f}).y == 1.5f);
    CHECK(warns(loaded(textured("bitmap", kBright, "roughconductor", "specular_reflectance")),
                "'specular_reflectance' is up to 1.5"));
    CHECK(loaded(textured("bitmap", "<string name='filename' value='rounded.pfm'/>")).warnings.empty());
    // Products: of a texture and a number, either way.
    const std::string nested = "<texture type='bitmap'>" + kBright + "</texture>";
    CHECK(warns(loaded(textured("scale", "<float name='scale' value='2'/>" + nested)), "up to 3,"));
    CHECK(loaded(textured("scale", "<float name='scale' value='0.5'/>" + nested)).warnings.empty());
    CHECK(
        warns(loaded(textured("scale", "<float name='scale' value='4'/><texture type='checkerboard'/>")), "up to 1.6"));
    CHECK(warns(loaded(textured("rawconstant", "<vector name='value' x='1' y='2' z='0'/>")), "up to 2,"));
    // Lights shine as they want.
    CHECK(loaded("<shape type='rectangle'><emitter type='area'><texture type='bitmap' name='radiance'>" + kBright +
                 "</texture></emitter></shape>")
              .warnings.empty());

    folder.write("walls.ply", kHead + "0 0 0 0.2 0.3 1.25\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n");
    const Scene mesh = loaded(
        "<shape type='ply'><string name='filename' value='walls.ply'/><bsdf type='diffuse'><texture "
        "type='mesh_attribute' name='reflectance'><string name='name' value='vertex_color'/></texture></bsdf></shape>");
    CHECK(warns(mesh, "'reflectance' is up to 1.25, by " + (folder.path / "walls.ply").string()));
}

TEST_CASE("colours below 0 in images count as 0, with a note; heights may be negative") {
    const TempFolder folder;
    folder.write("bright.pfm", pfm(-0.5f, 0.5f, 0.25f));
    const auto loaded = [&](const std::string& body) { return load(body, {}, "3.0.0", &folder); };
    const std::string said = "bright.pfm: colours below 0, down to -0.5, count as 0";
    const Scene s = loaded(textured("bitmap", kBright));
    CHECK(has_note(s, said));
    CHECK(reflectance(s, 0, {0.5f, 0.5f}) == Rgb{0, 0.5f, 0.25f});
    CHECK(has_note(loaded("<shape type='rectangle'><emitter type='area'><texture type='bitmap' name='radiance'>" +
                          kBright + "</texture></emitter></shape>"),
                   said));
    CHECK(has_note(loaded("<emitter type='envmap'>" + kBright + "</emitter><shape type='rectangle'/>"), said));
    CHECK_FALSE(has_note(loaded("<shape type='rectangle'><bsdf type='bumpmap'><texture type='bitmap'>" + kBright +
                                "</texture><bsdf type='diffuse'/></bsdf></shape>"),
                         said));
    CHECK(contains(error_of(textured("rawconstant", "<vector name='value' x='-1' y='0' z='0'/>")), "is negative"));
}

TEST_CASE("pbrt: images that reflect more than 1 reflect 1, as there") {
    const TempFolder folder;
    folder.write("bright.pfm", pfm(0.5f, 1.5f, 0.25f));
    const auto loaded = [&](const std::string& scale) {
        return load_pbrt_world(
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"bright.pfm\" \"float scale\" " + scale +
                "\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n" + kUnitTriangle,
            {}, &folder);
    };
    const Scene s = loaded("1");
    CHECK(has_note(s, "up to 1.5, by " + (folder.path / "bright.pfm").string() + ", and is clipped at 1"));
    check_rgb(reflectance(s, 0, {0.5f, 0.5f}), {0.5f, 1, 0.25f});
    check_rgb(reflectance(loaded("4"), 0, {0.5f, 0.5f}), {1, 1, 1});
    CHECK_FALSE(has_note(loaded("0.5"), "clipped at 1"));
}

TEST_CASE("glTF: factors and colours of vertices above 1 are 1, with a note if they are more than rounded") {
    using namespace ambilux::test::gltf;
    const auto base = [](const Scene& s) {
        const auto p = s.bsdfs[s.materials[s.shapes[0].material].front].as<Principled>();
        return eval_rgb<kAllFeatures>(s.view(), p.base_color, {0.25f, 0.25f});
    };
    const auto with_factor = [&](double factor) {
        Json j = quad_scene();
        j["materials"][0] = {
            {"name", "gold"},
            {"pbrMetallicRoughness", {{"baseColorFactor", {factor, 0.5, 0.25, 1}}, {"metallicFactor", factor}}}};
        return load(j);
    };
    CHECK(base(with_factor(1.00000012)) == Rgb{1, 0.5f, 0.25f});
    CHECK_FALSE(has_note(with_factor(1.00000012), "counts as 1"));
    CHECK(base(with_factor(1.25)) == Rgb{1, 0.5f, 0.25f});
    CHECK(has_note(with_factor(1.25), "material 0 'gold': baseColorFactor is 1.25 and counts as 1"));

    const auto with_colors = [&](float last) {
        Json j = quad_scene();
        j["materials"][0] = {{"pbrMetallicRoughness", {{"metallicFactor", 0}}}};
        attributes(j)["COLOR_0"] =
            add_accessor<float>(j, {last, last, last, 1, 1, 1, 1, 1, 1, 1, 1, 1}, "VEC3", kFloat, 4);
        return load(j);
    };
    CHECK(base(with_colors(1.0000001f)) == splat(1));
    CHECK_FALSE(has_note(with_colors(1.0000001f), "colour of its vertices"));
    CHECK(base(with_colors(1.2f)) == splat(1));
    CHECK(has_note(with_colors(1.2f), "primitive 0: the largest colour of its vertices is 1.2 and counts as 1"));
    CHECK(with_colors(1.2f).warnings.empty());
}
