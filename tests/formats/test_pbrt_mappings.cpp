// libs: ambilux_formats ZLIB::ZLIB
// timeout: 60
// Coordinates of textures in pbrt scenes, and what scenes of others were found to hold.
#include <sys/stat.h>

#include <cmath>
#include <cstring>

#include "core/atomic_file.h"
#include "formats/images/image_io.h"
#include "formats/images/image_write.h"
#include "formats/pbrt/coating.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

const std::string kTriangle = "Shape \"trianglemesh\" \"point3 P\" [1 0 2  3 0 2  1 4 2] \"integer indices\" [0 1 2] ";

std::string texture(const std::string& mapping, const std::string& name = "t") {
    return "Texture \"" + name + "\" \"spectrum\" \"checkerboard\" " + mapping + " ";
}

const std::string kTextured = "Material \"diffuse\" \"texture reflectance\" \"t\" ";

void check_uvs(const Scene& s, const std::vector<Vec2f>& expected) {
    REQUIRE(s.vertices.size() >= expected.size());
    for (size_t i = 0; i < expected.size(); ++i) {
        INFO(i);
        CHECK(s.vertices[i].u == Approx(expected[i].x).margin(1e-5));
        CHECK(s.vertices[i].v == Approx(expected[i].y).margin(1e-5));
    }
}

std::string pfm(float scale, std::initializer_list<float> values, bool grey = false) {
    std::string out = (grey ? "Pf\n2 2\n" : "PF\n2 2\n") + std::to_string(scale) + "\n";
    for (const float v : values) {
        char bytes[4];
        memcpy(bytes, &v, 4);
        if (scale > 0) std::swap(bytes[0], bytes[3]), std::swap(bytes[1], bytes[2]);
        out.append(bytes, 4);
    }
    return out;
}

}  // namespace

TEST_CASE("planar mappings take coordinates from places in the world") {
    const std::string planar =
        texture("\"string mapping\" \"planar\" \"vector3 v1\" [.5 0 0] \"vector3 v2\" [0 .25 .5] \"float udelta\" 3");
    check_uvs(load_pbrt_world(planar + kTextured + kTriangle), {{3.5f, 1}, {4.5f, 1}, {3.5f, 2}});
    // The texture's transform, and that of the shape.
    check_uvs(load_pbrt_world("AttributeBegin Translate 1 0 0 Scale 2 2 2 " + planar + "AttributeEnd Translate 0 0 2 " +
                              kTextured + kTriangle),
              {{3, 1}, {3.5f, 1}, {3, 1.5f}});
    // A sphere becomes a mesh.
    const Scene s = load_pbrt_world(planar + kTextured + "Shape \"sphere\"");
    CHECK(s.quadrics.empty());
    for (size_t i = 0; i < s.vertices.size(); i += 997)
        CHECK(s.vertices[i].u == Approx(3 + 0.5 * double(s.vertices[i].p.x)).margin(1e-5));
}

TEST_CASE("cylindrical and spherical mappings have no seam within a triangle") {
    const std::string cylindrical = texture("\"string mapping\" \"cylindrical\"");
    // From (-1,-1,0) over (-1,1,0) to (1,0,3): angles -135, 135 and 0 degrees, of which 0 is at s = 1/2.
    const std::string mesh =
        "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0  -1 1 0  1 0 3] \"integer indices\" [0 1 2] ";
    check_uvs(load_pbrt_world(cylindrical + kTextured + mesh), {{1.125f, 0}, {0.875f, 0}, {0.5f, 3}});
    const std::string spherical = texture("\"string mapping\" \"spherical\"");
    const Scene s =
        load_pbrt_world(spherical + kTextured +
                        "Shape \"trianglemesh\" \"point3 P\" [1 0 0  0 1 0  0 0 2] \"integer indices\" [0 1 2]");
    check_uvs(s, {{0.5f, 0}, {0.5f, 0.25f}, {0, 0.125f}});  // the pole lies between the others
    CHECK(has_note(s, "linear over each triangle"));
    const std::string two = texture("", "u") + cylindrical +
                            "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"texture reflectance\" \"t\" "
                            "MakeNamedMaterial \"b\" \"string type\" \"diffuse\" \"texture reflectance\" \"u\" "
                            "Material \"mix\" \"string materials\" [\"a\" \"b\"] ";
    CHECK(contains(pbrt_error("WorldBegin " + two + kTriangle), "textures of different mappings on one surface"));
    CHECK(contains(pbrt_error("WorldBegin " + texture("\"string mapping\" \"cubic\"")),
                   "unknown texture mapping 'cubic'"));
}

TEST_CASE("meshes without coordinates have those of pbrt, also in files and under masks") {
    const TempFolder folder;
    const std::string head =
                          "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                          "property float z\n",
                      faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    folder.write("bare.ply", head + faces + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    folder.write("full.ply", head + "property float u\nproperty float v\n" + faces +
                                 "0 0 0 .1 .2\n1 0 0 .3 .4\n0 1 0 .5 .6\n3 0 1 2\n");
    const auto file = [](const std::string& name) { return "Shape \"plymesh\" \"string filename\" \"" + name + "\" "; };
    const std::vector<Vec2f> defaults = {{0, 0}, {1, 0}, {1, 1}};
    check_uvs(load_pbrt_world(texture("") + kTextured + file("bare.ply"), {}, &folder), defaults);
    check_uvs(load_pbrt_world(texture("") + kTextured + file("full.ply"), {}, &folder), {{0.1f, 0.2f}, {0.3f, 0.4f}});
    const std::string mask = "Texture \"m\" \"float\" \"checkerboard\" ";
    check_uvs(load_pbrt_world(mask + kTriangle + "\"texture alpha\" \"m\""), defaults);
    check_uvs(load_pbrt_world(mask + file("bare.ply") + "\"texture alpha\" \"m\"", {}, &folder), defaults);
}

TEST_CASE("maps of floats, from bottom to top and in either byte order") {
    const TempFolder folder;
    for (const float scale : {-1.0f, 2.0f}) {
        INFO(scale);
        folder.write("t.pfm", pfm(scale, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
        const Texels t = read_image("t.pfm", read_file(folder / "t.pfm"));
        REQUIRE(t.floats.size() == 16);
        CHECK(t.is_linear);
        CHECK(t.floats[0] == 7 * std::fabs(scale));  // the upper left
        CHECK(t.floats[8] == 1 * std::fabs(scale));
        CHECK(t.floats[3] == 1);
    }
    const Texels grey = read_image("t.pfm", pfm(-1, {1, 2, 3, 4}, true));
    CHECK(grey.floats[6] == 4);
    CHECK_THROWS_AS(read_image("t.pfm", pfm(-1, {1, 2, 3})), Error);
    CHECK_THROWS_AS(read_image("t.pfm", "PF\n2 2\nnone\n"), Error);
    CHECK_THROWS_AS(read_image("t.pfm", "PF\n70000 70000\n-1\n"), Error);
}

TEST_CASE("lights of two sides on nothing, and portals that look at one map") {
    const TempFolder folder;
    const Scene pane = load_pbrt_world(
        "AreaLightSource \"diffuse\" \"bool twosided\" true \"rgb L\" [1 2 3] Material \"interface\" " + kTriangle);
    CHECK(pane.emitters.size() == 2);
    CHECK(pane.shapes.size() == 2);

    write_float_image(folder / "sky.exr", 4, 4, std::vector<float>(48, 2.0f));
    const std::string sky = "LightSource \"infinite\" \"string filename\" \"sky.exr\" \"point3 portal\" ";
    const Scene one =
        load_pbrt_world(sky + "[0 0 0 1 0 0 1 1 0 0 1 0] " + sky + "[5 0 0 6 0 0 6 1 0 5 1 0]", {}, &folder);
    CHECK(one.emitters.size() == 1);
    CHECK(has_note(one, "portals that look at one map share its light"));
    check_rgb(one.emitters[0].radiance.value, splat(1));
}

TEST_CASE("options have a name and a value") {
    const auto loads = [](const std::string& options) {
        return pbrt_error(options + " WorldBegin " + kTriangle + "LightSource \"infinite\"");
    };
    CHECK(loads("Option \"seed\" 42 Option \"disablepixeljitter\" false Option \"msereferenceout\" \"x.txt\"") ==
          "no error");
    CHECK(loads("Option \"bool wavefront\" [true]") == "no error");
    CHECK_THAT(loads("Option \"forcediffuse\" true"), ContainsSubstring("'forcediffuse' is not supported"));
    CHECK_THAT(loads("Option \"bool disablepixeljitter\" [true]"), ContainsSubstring("is not supported"));
    CHECK_THAT(loads("Option seed 42"), ContainsSubstring("must be a string in quotes"));
    CHECK_THAT(pbrt_error("Option \"seed\""), ContainsSubstring("option 'seed' must have one value"));
    CHECK_THAT(loads("Option \"seed\" [1 2]"), ContainsSubstring("must have one value"));
}

TEST_CASE("materials may be named before they are defined") {
    const std::string a = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [.1 .2 .3] ",
                      mix = "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"a\" \"b\"] ",
                      b = "MakeNamedMaterial \"b\" \"string type\" \"conductor\" ";
    const auto same = [](const std::string& late, const std::string& early) {
        const Scene one = load_pbrt_world(late), two = load_pbrt_world(early);
        CHECK(one.materials.size() == two.materials.size());
        CHECK(one.shapes.size() == two.shapes.size());
        CHECK(one.emitters.size() == two.emitters.size());
        CHECK(one.instances.size() == two.instances.size());
        REQUIRE(!one.vertices.empty());
        CHECK(std::fabs(one.vertices[0].p.x - two.vertices[0].p.x) < 1e-6f);
        return one;
    };
    const std::string shape = "AttributeBegin Translate 5 0 0 AreaLightSource \"diffuse\" NamedMaterial \"a\" " +
                              kTriangle + " AttributeEnd ";
    same(shape + a, a + shape);
    const std::string mixed = "NamedMaterial \"m\" " + kTriangle;
    same(mixed + mix + b + a, a + b + mix + mixed);
    same(mix + mixed + a + b, a + b + mix + mixed);
    same("ObjectBegin \"o\" " + mixed + "ObjectEnd ObjectInstance \"o\" " + a + b + mix,
         a + b + mix + "ObjectBegin \"o\" " + mixed + "ObjectEnd ObjectInstance \"o\" ");
    CHECK_THAT(pbrt_error("WorldBegin " + mix + mixed + a), ContainsSubstring("unknown material 'b'"));
    CHECK_THAT(pbrt_error("WorldBegin NamedMaterial \"none\" " + kTriangle),
               ContainsSubstring("scene.pbrt:1: unknown material 'none'"));
}

TEST_CASE("ribbons face their normals, and u goes along curves") {
    const std::string curve =
        "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"float width0\" 1 \"float width1\" 2 ";
    const Scene flat = load_pbrt_world(curve + "\"string type\" \"ribbon\" \"normal N\" [0 0 2 0 0 2]");
    REQUIRE(flat.vertices.size() == 34);
    check_uvs(flat, {{0, 0}, {0, 1}, {1 / 16.0f, 0}});
    for (size_t i = 0; i < 34; ++i) {
        const MeshVertex& v = flat.vertices[i];
        CHECK(v.p.x == Approx(3 * double(v.u)).margin(1e-6));
        CHECK(v.p.y == Approx((double(v.v) - 0.5) * (1 + double(v.u))).margin(1e-6));
        CHECK(v.p.z == Approx(0).margin(1e-6));
        CHECK(v.n.z == Approx(1));
    }
    // A quarter of a turn, at a steady angle.
    const Scene twisted = load_pbrt_world(curve + "\"string type\" \"ribbon\" \"normal N\" [0 0 1 0 1 0]");
    check_rgb(twisted.vertices[16].n, {0, std::sqrt(0.5f), std::sqrt(0.5f)});
    check_rgb(twisted.vertices[32].n, {0, 1, 0});
    // Splines: two segments.
    const std::string spline =
        "Shape \"curve\" \"string basis\" \"bspline\" \"string type\" \"ribbon\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0 "
        "4 0 0] ";
    const Scene two = load_pbrt_world(spline + "\"normal N\" [0 0 1 0 0 1 0 0 1]");
    REQUIRE(two.vertices.size() == 68);
    CHECK(two.vertices[0].p.x == Approx(1));
    CHECK(two.vertices[67].p.x == Approx(3));
    CHECK_THAT(pbrt_error("WorldBegin " + spline),
               ContainsSubstring("a ribbon of 2 segments needs 3 normals N, not 0"));
    CHECK_THAT(pbrt_error("WorldBegin " + spline + "\"normal N\" [0 0 1 0 0 1]"), ContainsSubstring("needs 3 normals"));
    CHECK_THAT(pbrt_error("WorldBegin " + spline + "\"normal N\" [0 0 1 0 0 0 0 0 1]"),
               ContainsSubstring("normal is zero"));

    const Scene tube = load_pbrt_world(texture("") + kTextured + curve);
    for (size_t i = 0; i < tube.vertices.size(); ++i)
        CHECK(tube.vertices[i].u == Approx(double(tube.vertices[i].p.x) / 3).margin(1e-5));
    CHECK(has_note(tube, "textures wrap around curves"));
}

TEST_CASE("coatings dim what passes them") {
    // Without losses and for walks without end the surface is as it says.
    check_rgb(pbrt::Coating{1.5, 0, 100000}.diffuse_below({0.2f, 0.5f, 0.9f}), {0.2f, 0.5f, 0.9f}, 1e-5f);
    // A random walk as pbrt's, of four million paths.
    check_rgb(pbrt::Coating{}.diffuse_below({0.2f, 0.5f, 0.9f}), {0.19490f, 0.48446f, 0.8527f}, 1e-3);
    check_rgb(pbrt::Coating{1.5, 1, 10}.diffuse_below(splat(0.5f)), splat(0.05066f), 3e-4);

    const auto reflectance = [](const std::string& parameters, const TempFolder* folder = nullptr) {
        const Scene s = load_pbrt_world("Material \"coateddiffuse\" " + parameters + " " + kTriangle, {}, folder);
        return s.bsdfs[s.materials[s.shapes[0].material].front].as<Plastic>().reflectance;
    };
    check_rgb(reflectance("\"rgb reflectance\" [.2 .5 .9]").value, {0.19490f, 0.48446f, 0.8527f}, 1e-3);
    check_rgb(reflectance("\"float thickness\" 0 \"integer maxdepth\" 1000").value, splat(0.5f));
    check_rgb(reflectance("\"float thickness\" .2").value, splat(0.29930f), 3e-4);
    CHECK(contains(pbrt_error("WorldBegin Material \"coateddiffuse\" \"integer maxdepth\" 0 " + kTriangle),
                   "must be positive"));

    // A metal at normal incidence: one way through the layer and back.
    const auto metal = [](const std::string& thickness) {
        const Scene s = load_pbrt_world("Material \"coatedconductor\" \"float thickness\" " + thickness + kTriangle);
        return s.bsdfs[s.materials[s.shapes[0].material].front].as<Conductor>().specular_reflectance.value;
    };
    const Rgb thin = metal("0 "), thick = metal("5 ");
    for (int i = 0; i < 3; ++i) CHECK(thick[i] < 0.1f * thin[i]);
}

TEST_CASE("parameters that nobody knows are refused in integrators too") {
    CHECK(pbrt_error("Integrator \"bdpt\" \"bool visualizeweights\" false \"integer maxdepth\" 3 WorldBegin " +
                     kTriangle) == "no error");
    CHECK(contains(pbrt_error("Integrator \"path\" \"integer maxDepth\" 3 WorldBegin " + kTriangle),
                   "unknown parameter 'maxDepth' of Integrator 'path'"));
    CHECK(has_note(load_pbrt_world(kTriangle + "\"vector3 S\" [1 0 0 1 0 0 1 0 0]"), "tangents S are left out"));
}

TEST_CASE("a pipe in the place of a mesh with textures is refused") {
    const TempFolder folder;
    REQUIRE(::mkfifo((folder / "pipe.ply").c_str(), 0600) == 0);
    const std::string mesh = "Shape \"plymesh\" \"string filename\" \"" + folder / "pipe.ply" + "\"";
    CHECK(contains(pbrt_error("WorldBegin " + texture("") + kTextured + mesh), "no regular file"));
}
