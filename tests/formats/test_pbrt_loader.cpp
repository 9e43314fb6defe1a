// libs: ambilux_formats ZLIB::ZLIB JPEG::JPEG
// timeout: 60
// What pbrt scenes become, what is refused and how, and files that lie.
#include <zlib.h>

#include <cmath>

#include "formats/images/image_write.h"
#include "formats/meshes/loop_subdivision.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"
#include "transport/emitter/envmap.h"
#include "transport/sensor/camera.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

const std::string kTriangle = "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0] \"integer indices\" [0 1 2]\n";
const std::string kSphere = "Shape \"sphere\"\n";

const BsdfRecord& bsdf(const Scene& s, size_t shape = 0) {
    return s.bsdfs[s.materials[s.shapes[shape].material].front];
}

Scene with_material(const std::string& material) { return load_pbrt_world("Material " + material + "\n" + kSphere); }

std::string world_error(const std::string& world, const LoadOptions& options = {}) {
    return pbrt_error("WorldBegin\n" + world + "\n", options);
}

std::string gzip(const std::string& bytes) {
    z_stream stream{};
    REQUIRE(deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY) == Z_OK);
    std::string out(bytes.size() + 1000, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = uInt(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = uInt(out.size());
    REQUIRE(deflate(&stream, Z_FINISH) == Z_STREAM_END);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

}  // namespace

TEST_CASE("transforms apply from the last to the first, and attributes come back") {
    const Scene s = load_pbrt_world("Translate 1 2 3 Scale 2 2 2 AttributeBegin Rotate 90 0 0 1 Translate 1 0 0\n" +
                                    kTriangle + "CoordinateSystem \"there\" AttributeEnd\n" + kTriangle +
                                    "Identity ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]\n" + kTriangle +
                                    "CoordSysTransform \"there\"\n" + kTriangle);
    REQUIRE(s.shapes.size() == 4);
    const Vec3f expected[4] = {{1, 4, 3}, {1, 2, 3}, {5, 6, 7}, {1, 4, 3}};
    for (size_t i = 0; i < 4; ++i) check_rgb(s.vertices[3 * i].p, expected[i]);
}

TEST_CASE("ReverseOrientation and mirrors leave normals as pbrt has them") {
    const auto normal = [](const std::string& before) {
        const Scene s = load_pbrt_world(before + kTriangle);
        const Triangle& t = s.triangles[0];
        return normalize(cross(s.vertices[t.v1].p - s.vertices[t.v0].p, s.vertices[t.v2].p - s.vertices[t.v0].p));
    };
    check_rgb(normal(""), {0, 0, 1});
    check_rgb(normal("ReverseOrientation "), {0, 0, -1});
    check_rgb(normal("Scale -1 1 1 "), {0, 0, 1});
    check_rgb(normal("Scale 1 1 -1 "), {0, 0, -1});
}

TEST_CASE("mirrored files of meshes and quadrics keep their outside, as in pbrt") {
    const TempFolder folder;
    folder.write("t.ply",
                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                 "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    const auto z = [&](const std::string& before) {
        const Scene s = load_pbrt_world(before + "Shape \"plymesh\" \"string filename\" \"t.ply\"", {}, &folder);
        const Triangle& t = s.triangles[0];
        return normalize(cross(s.vertices[t.v1].p - s.vertices[t.v0].p, s.vertices[t.v2].p - s.vertices[t.v0].p)).z;
    };
    CHECK(z("") == 1);
    CHECK(z("Scale -1 1 1 ") == 1);
    CHECK(z("Scale 1 1 -1 ") == -1);
    CHECK(z("ReverseOrientation Scale -1 1 1 ") == -1);
    for (const std::string type : {"sphere", "disk", "cylinder"}) {
        INFO(type);
        const auto flip = [&](const std::string& before) {
            return load_pbrt_world(before + "Shape \"" + type + "\"").quadrics[0].flip;
        };
        CHECK(flip("") == 0);
        CHECK(flip("Scale -1 1 1 ") == 0);
        CHECK(flip("ReverseOrientation Scale -1 1 1 ") == 1);
    }
}

TEST_CASE("meshes without normals are flat") {
    const Scene s = load_pbrt_world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  0 0 1] \"integer indices\" [0 1 2 0 1 3]");
    CHECK(!(s.shapes[0].flags & kShapeHasNormals));
}

TEST_CASE("materials become the models that they are") {
    const auto type = [](const std::string& material) { return bsdf(with_material(material)).type; };
    CHECK(type("\"diffuse\"") == BsdfType::diffuse);
    CHECK(type("\"coateddiffuse\"") == BsdfType::plastic);
    CHECK(type("\"coateddiffuse\" \"float roughness\" .1") == BsdfType::rough_plastic);
    CHECK(type("\"conductor\"") == BsdfType::conductor);
    CHECK(type("\"conductor\" \"float roughness\" .1") == BsdfType::rough_conductor);
    CHECK(type("\"coatedconductor\"") == BsdfType::conductor);
    CHECK(type("\"dielectric\"") == BsdfType::dielectric);
    CHECK(type("\"dielectric\" \"float uroughness\" .1 \"float vroughness\" .2") == BsdfType::rough_dielectric);
    CHECK(type("\"thindielectric\"") == BsdfType::thin_dielectric);
    CHECK(with_material("\"diffuse\"").materials[0].two_sided == 1);

    const Scene rough =
        with_material("\"dielectric\" \"float uroughness\" .04 \"float vroughness\" .09 \"float eta\" 1.3");
    const auto& p = bsdf(rough).as<RoughDielectric>();
    CHECK(p.alpha_u.value == Approx(0.2f));
    CHECK(p.alpha_v.value == Approx(0.3f));
    CHECK(p.ior == Approx(1.3f));
    CHECK(p.distribution == Microfacets::ggx);
    const Scene plain = with_material("\"conductor\" \"float roughness\" .04 \"bool remaproughness\" false");
    CHECK(bsdf(plain).as<RoughConductor>().alpha_u.value == Approx(0.04f));

    const Scene gold = with_material("\"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\"");
    check_rgb(bsdf(gold).as<Conductor>().eta, {0.143036f, 0.375307f, 1.44205f});
    const Scene grey = with_material("\"conductor\" \"rgb reflectance\" [.5 .5 .5]");
    check_rgb(bsdf(grey).as<Conductor>().k, splat(2));  // k² = 4 R/(1-R)
    CHECK(has_note(with_material("\"coateddiffuse\""), "coateddiffuse is approximated by plastic"));
    CHECK(has_note(with_material("\"coatedconductor\""), "coatedconductor is approximated by conductor"));
}

TEST_CASE("a mix and a diffuse transmission are blends whose sum is what was asked for") {
    const Scene s = load_pbrt_world(
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string type\" \"dielectric\"\n"
        "Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" .3\n" +
        kSphere + "Material \"diffusetransmission\" \"rgb reflectance\" [.1 .2 .3] \"rgb transmittance\" [.4 .1 .2]\n" +
        kSphere);
    const Material& mix = s.materials[s.shapes[0].material];
    CHECK(mix.second_weight.value == Approx(0.3f));
    CHECK(s.bsdfs[s.materials[mix.second].front].type == BsdfType::dielectric);
    const Material& both = s.materials[s.shapes[1].material];
    const float w = both.second_weight.value;
    check_rgb(s.bsdfs[s.materials[both.first].front].as<Diffuse>().reflectance.value * (1 - w), {0.1f, 0.2f, 0.3f});
    check_rgb(s.bsdfs[s.materials[both.second].front].as<DiffuseTransmitter>().transmittance.value * w,
              {0.4f, 0.1f, 0.2f});
}

TEST_CASE("diffuse transmission with images: shares of the blend leave room for the brightest texel") {
    const TempFolder folder;
    folder.write("t.png", png_bytes(2, 1, {255, 255, 255, 0, 0, 0}));
    const auto load = [&](const std::string& scale, const std::string& t) {
        return load_pbrt_world(
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\" "
            "\"float scale\" " +
                scale + "\nMaterial \"diffusetransmission\" \"texture reflectance\" \"t\" \"rgb transmittance\" [" + t +
                "]\n" + kSphere,
            {}, &folder);
    };
    const Scene s = load(".75", ".25 .1 .2");
    const Material& both = s.materials[s.shapes[0].material];
    const float w = both.second_weight.value;
    const ParamRgb& r = s.bsdfs[s.materials[both.first].front].as<Diffuse>().reflectance;
    Rgb brightest{};
    for (const float u : {0.25f, 0.75f}) brightest = max(brightest, eval_rgb<kAllFeatures>(s.view(), r, {u, 0.5f}));
    check_rgb(brightest * (1 - w), splat(0.75f), 1e-3);
    check_rgb(s.bsdfs[s.materials[both.second].front].as<DiffuseTransmitter>().transmittance.value * w,
              {0.25f, 0.1f, 0.2f});
    CHECK(has_note(load("1", ".5 .5 .5"), "add up to more than 1: both are clipped"));
    CHECK(contains(pbrt_error("WorldBegin Material \"diffusetransmission\" \"rgb reflectance\" [.6 .5 .1] "
                              "\"rgb transmittance\" [.2 .4 .6] Shape \"sphere\""),
                   "of diffusetransmission add up to more than 1, which is not supported"));
}

TEST_CASE("colours: spaces, black bodies, spectra and what lights make of them") {
    const auto light = [](const std::string& parameters, const std::string& before = "") {
        const Scene s = load_pbrt_world(before + "LightSource \"point\" " + parameters);
        return s.emitters[0].radiance.value;
    };
    check_rgb(light("\"rgb I\" [1 2 3] \"float scale\" 2"), {2, 4, 6});
    CHECK(luminance(light("\"blackbody I\" 3000 \"float scale\" 5")) == Approx(5));
    CHECK(luminance(light("\"spectrum I\" [300 7 900 7]")) == Approx(1));
    check_rgb(light("\"spectrum I\" \"stdillum-D65\""), splat(1));
    // Fluorescent lamps: F7 is daylight, F12 warm; both of luminance 1.
    check_rgb(light("\"spectrum I\" \"stdillum-F7\""), splat(1), 5e-3);
    const Rgb f12 = light("\"spectrum I\" \"stdillum-F12\"");
    CHECK(luminance(f12) == Approx(1).epsilon(1e-4));
    CHECK(f12.x > 1.3);
    CHECK(f12.z < 0.4);
    CHECK(contains(pbrt_error("WorldBegin LightSource \"point\" \"spectrum I\" \"stdillum-F13\""),
                   "known by the name 'stdillum-F13'"));
    const Rgb warm = light("\"blackbody I\" 3000");
    CHECK(warm.x > warm.y);
    CHECK(warm.y > warm.z);
    // White stays white, and the red of a wider gamut is redder than ours (ITU-R BT.2087).
    check_rgb(light("\"rgb I\" [1 1 1]", "ColorSpace \"rec2020\" "), splat(1), 1e-4);
    check_rgb(light("\"rgb I\" [1 1 1]", "ColorSpace \"dci-p3\" "), splat(1), 1e-4);
    check_rgb(light("\"rgb I\" [1 0 0]", "ColorSpace \"rec2020\" "), {1.6605f, 0, 0}, 1e-3);
    const Rgb half = light("\"rgb I\" [1 .5 .25]", "ColorSpace \"dci-p3\" ");
    check_rgb(half, {1.1125f, 0.4790f, 0.2155f}, 2e-3);
    CHECK(light("\"float power\" 10").x == Approx(10 / (4 * M_PI)));
}

TEST_CASE("the film's exposure scales lights") {
    const auto value = [](const std::string& options) {
        return load_pbrt_text(options + " WorldBegin LightSource \"distant\"").emitters[0].radiance.value.x;
    };
    CHECK(value("") == 1);
    CHECK(value("Film \"rgb\" \"float iso\" 200") == 2);
    CHECK(value("Film \"rgb\" \"float iso\" 200 Camera \"perspective\" \"float shutterclose\" .25") == 0.5f);
}

TEST_CASE("cameras: the field of view is that of the shorter side, x points to the right") {
    const Scene s = load_pbrt_text(
        "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100 LookAt 1 2 3  1 2 10 "
        " 0 1 0 Camera \"perspective\" \"float fov\" 90 Integrator \"path\" \"integer maxdepth\" 4 WorldBegin");
    CHECK(s.sensor.tan_half_fov.x == Approx(2));
    CHECK(s.sensor.tan_half_fov.y == Approx(1));
    CHECK(s.integrator.max_depth == 5);
    // Left in the image is -x in pbrt's left-handed view along +z.
    check_rgb(s.sensor.to_world.vector({1, 0, 0}), {-1, 0, 0});
    check_rgb(s.sensor.to_world.vector({0, 0, 1}), {0, 0, 1});
    check_rgb(s.sensor.to_world.point({0, 0, 0}), {1, 2, 3});
    const Scene o = load_pbrt_text(
        "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100 Camera \"orthographic\" "
        "\"float screenwindow\" [-4 4 -2 2] WorldBegin");
    CHECK(o.sensor.tan_half_fov.x == Approx(4));
    CHECK(o.sensor.tan_half_fov.y == Approx(2));
}

TEST_CASE("cameras: a spherical one begins at x and counts to z") {
    const std::string look = "Scale 2 2 2 LookAt 1 2 3  1 2 10  0 1 0 Camera \"spherical\" ",
                      film = "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 4 ";
    const Scene s = load_pbrt_text(film + look + "\"string mapping\" \"equirectangular\" WorldBegin");
    CHECK(s.sensor.type == SensorType::spherical);
    // pbrt's direction at (u,v): cos(2 pi u) sin(pi v), cos(pi v), sin(2 pi u) sin(pi v).
    const struct {
        Vec2f film;
        Vec3f d;
    } cases[] = {{{0, 2}, {1, 0, 0}},
                 {{2, 2}, {0, 0, 1}},
                 {{4, 2}, {-1, 0, 0}},
                 {{6, 2}, {0, 0, -1}},
                 {{1, 2}, {float(M_SQRT1_2), 0, float(M_SQRT1_2)}},
                 {{3, 0}, {0, 1, 0}},
                 {{3, 4}, {0, -1, 0}}};
    for (const auto& c : cases) {
        const CameraSample ray = sample_camera_ray<kAllFeatures>(s.sensor, c.film, {0.5f, 0.5f});
        CHECK(length(ray.d - c.d) < 1e-5f);
        check_rgb(ray.o, {1, 2, 3});
    }
    CHECK_THROWS_WITH(load_pbrt_text(film + look + "WorldBegin"), ContainsSubstring("'equalarea'"));
}

TEST_CASE("textures: t runs upwards, constants and images fold, checkerboards have cells of size 1") {
    const TempFolder folder;
    // Rows from the top: red green / blue white.
    folder.write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}));
    const std::string
        image = "Texture \"i\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\"\n",
        quad =
            "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"point2 uv\" [0 0 1 0 1 1 0 1] "
            "\"integer indices\" [0 1 2 0 2 3]\n";
    const auto at = [&](const std::string& textures, Vec2f uv) {
        const Scene s = load_pbrt_world(
            image + textures + "Material \"diffuse\" \"texture reflectance\" \"t\"\n" + quad, {}, &folder);
        return reflectance(s, 0, uv);
    };
    const std::string
        scaled = "Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"i\" \"float scale\" .5\n",
        mixed = "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"i\" \"rgb tex2\" [1 1 1] \"float amount\" .25\n",
        inverted =
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"bool invert\" true \"string "
            "filter\" \"point\"\n",
        checker =
            "Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"rgb tex1\" [.1 .2 .3] \"rgb tex2\" [.4 "
            ".5 .6]\n";
    check_rgb(at(scaled, {0.25f, 0.75f}), {0.5f, 0, 0});
    check_rgb(at(scaled, {0.75f, 0.75f}), {0, 0.5f, 0});
    check_rgb(at(scaled, {0.25f, 0.25f}), {0, 0, 0.5f});
    check_rgb(at(mixed, {0.25f, 0.75f}), {1, 0.25f, 0.25f});
    check_rgb(at(inverted, {0.25f, 0.75f}), {0, 1, 1});
    check_rgb(at(checker, {0.1f, 0.5f}), {0.1f, 0.2f, 0.3f});
    check_rgb(at(checker, {0.3f, 0.5f}), {0.4f, 0.5f, 0.6f});
    check_rgb(at(checker, {0.6f, 0.5f}), {0.1f, 0.2f, 0.3f});
}

TEST_CASE("images lie on spheres, disks and cylinders as pbrt has them") {
    const TempFolder folder;
    folder.write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}));
    const Scene s = load_pbrt_world(
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\" Material "
        "\"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\" Shape \"disk\" Shape \"cylinder\"",
        {}, &folder);
    // Coordinates of shapes are Mitsuba's: azimuth and angle to +z; radius and azimuth; azimuth and height.
    check_rgb(reflectance(s, 0, {0.25f, 0.1f}), {1, 0, 0});  // the top of the image is the pole +z
    check_rgb(reflectance(s, 0, {0.75f, 0.9f}), {1, 1, 1});
    check_rgb(reflectance(s, 1, {0.25f, 0.1f}), {1, 0, 0});  // and the centre of the disk, where pbrt's v is 1
    check_rgb(reflectance(s, 1, {0.75f, 0.6f}), {1, 1, 1});
    check_rgb(reflectance(s, 2, {0.25f, 0.9f}), {1, 0, 0});
    check_rgb(reflectance(s, 2, {0.75f, 0.1f}), {1, 1, 1});
}

TEST_CASE("factors of textures: reflectances end at 1, heights may be negative, coatings have a mean roughness") {
    const TempFolder folder;
    folder.write("t.png", png_bytes(2, 1, {255, 255, 255, 0, 0, 0}));
    const std::string
        image = "\"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\" \"string encoding\" \"linear\"",
        quad =
            "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0] \"point2 uv\" [0 0 1 0 1 1] \"integer indices\" "
            "[0 1 2]";
    const Scene s =
        load_pbrt_world("Texture \"t\" \"spectrum\" " + image + " \"float scale\" 3 Texture \"b\" \"float\" " + image +
                            " \"float scale\" -2\n"
                            "Texture \"r\" \"float\" " +
                            image +
                            " \"float scale\" .5\n"
                            "Material \"diffuse\" \"texture reflectance\" \"t\" \"texture displacement\" \"b\" " +
                            quad + " Material \"coateddiffuse\" \"texture roughness\" \"r\" " + quad,
                        {}, &folder);
    check_rgb(reflectance(s, 0, {0.25f, 0.5f}), splat(1));
    CHECK(bsdf(s).bump_map >= 0);
    CHECK(bsdf(s).bump_scale == -2);
    CHECK(bsdf(s, 1).as<RoughPlastic>().alpha.value == Approx(0.5f));
    CHECK(has_note(s, "mean of its roughness"));
}

TEST_CASE("environment maps keep their directions") {
    const TempFolder folder;
    constexpr int n = 64;
    // A direction's colour says where it points. The inverse of the equal-area octahedral map (Clarberg 2008), as an
    // area-preserving map by its cells: found by search, apart from the reader's formula.
    std::vector<float> texels;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const double u = 2 * (x + 0.5) / n - 1, v = 2 * (y + 0.5) / n - 1, d = 1 - std::fabs(u) - std::fabs(v);
            const double r = 1 - std::fabs(d), z = d < 0 ? -(1 - r * r) : 1 - r * r;
            const double phi = ((std::fabs(v) - std::fabs(u)) / r + 1) * M_PI / 4, sine = std::sqrt(1 - z * z);
            for (double c : {std::copysign(std::cos(phi), u) * sine, std::copysign(std::sin(phi), v) * sine, z})
                texels.push_back(float(c + 1));
        }
    write_float_image(folder / "e.exr", n, n, texels);
    const Scene s = load_pbrt_world(
        "Rotate 90 0 0 1 LightSource \"infinite\" \"string filename\" \"e.exr\" \"float scale\" 2", {}, &folder);
    const Emitter& e = s.emitters[0];
    for (const Vec3f d : {Vec3f{1, 2, 3}, Vec3f{-3, 1, 1}, Vec3f{0.1f, -1, 0.2f}, Vec3f{1, 1, -4}, Vec3f{-1, -2, -1}}) {
        const Vec3f w = normalize(d);
        // What shines from the light's x is seen along the world's y.
        const Vec3f local = {w.y, -w.x, w.z};
        check_rgb(envmap_radiance(s.view(), e, w), (local + splat(1)) * 2, 0.1);
    }
}

TEST_CASE("objects are flattened with both transforms") {
    const Scene s = load_pbrt_world("ObjectBegin \"o\" Translate 1 0 0\n" + kTriangle +
                                    "ObjectEnd Scale 2 2 2 ObjectInstance \"o\" Translate 0 5 0 ObjectInstance \"o\"");
    REQUIRE(s.shapes.size() == 2);
    check_rgb(s.vertices[0].p, {2, 0, 0});
    check_rgb(s.vertices[3].p, {2, 10, 0});
}

TEST_CASE("includes, packed files and attributes for all that follows") {
    const TempFolder folder;
    folder.write("sub/inner.pbrt.gz", gzip("Translate 1 0 0 Shape \"sphere\""));
    folder.write(
        "m.ply.gz",
        gzip("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
    const Scene s = load_pbrt_world(
        "Attribute \"shape\" \"float radius\" .25 Import \"sub/inner.pbrt.gz\" Include \"sub/inner.pbrt.gz\" "
        "Shape \"sphere\" Shape \"plymesh\" \"string filename\" \"m.ply.gz\"",
        {}, &folder);
    REQUIRE(s.quadrics.size() == 3);
    CHECK(s.quadrics[0].radius == 0.25f);
    CHECK(s.quadrics[1].to_world.m[0][3] == 1);  // what an import moves stays in it
    CHECK(s.quadrics[2].to_world.m[0][3] == 1);
    CHECK(s.triangles.size() == 1);
}

TEST_CASE("patches and subdivision surfaces are tessellated") {
    const Scene flat = load_pbrt_world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]");
    CHECK(flat.triangles.size() == 2);
    const Scene bent = load_pbrt_world("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]");
    CHECK(bent.triangles.size() == 128);
    CHECK(has_note(bent, "bilinear patches"));
    // The limit of an octahedron is round, to what Loop's surface is.
    const Scene round = load_pbrt_world(
        "Shape \"loopsubdiv\" \"integer levels\" 4 \"point3 P\" [1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1] \"integer "
        "indices\" "
        "[0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5]");
    CHECK(round.triangles.size() == 8 * 256);
    float least = 10, most = 0;
    for (const MeshVertex& v : round.vertices) least = std::min(least, length(v.p)), most = std::max(most, length(v.p));
    CHECK(most / least < 1.25f);
    // Refinement leaves a vertex on the limit surface: half of itself and an eighth of each of its four neighbours.
    check_rgb(round.vertices[0].p, {0.5f, 0, 0});
    // Loop's surface of a regular plane mesh is the plane mesh: its boundary and the inner vertices stay in it.
    Mesh plane;
    for (int i = 0; i < 9; ++i) plane.positions.push_back({float(i % 3), float(i / 3), 2});
    for (uint32_t i : {0u, 1u, 3u, 4u}) plane.faces.insert(plane.faces.end(), {{i, i + 1, i + 4}, {i, i + 4, i + 3}});
    for (Vec3f p : subdivide_loop("plane", plane, 2, {}).positions) CHECK(p.z == Approx(2));
}

TEST_CASE("what is not known is refused by name, file and line") {
    const std::vector<std::pair<std::string, std::string>> cases = {
        {"Shape \"hair\"", "shape 'hair' is not supported"},
        {"LightSource \"laser\"", "light 'laser' is not supported"},
        {"AreaLightSource \"diffuse\" \"bool twosided\" true Material \"dielectric\" Shape \"sphere\"", "two sides"},
        {"Material \"hair\" Shape \"sphere\"", "material 'hair' is not supported"},
        {"Material \"subsurface\" Shape \"sphere\"", "material 'subsurface' is not supported"},
        {"Texture \"t\" \"float\" \"ptex\"", "texture type 'ptex' is not supported"},
        {"Shape \"sphere\" \"float radius\" 1 \"float size\" 2", "unknown parameter 'size' of Shape 'sphere'"},
        {"MakeNamedMedium \"m\" \"string type\" \"homogeneous\"", "media are not supported"},
    };
    for (const auto& [world, problem] : cases) {
        INFO(world);
        const std::string error = world_error("\n" + world);
        CHECK(contains(error, "scene.pbrt:3: "));
        CHECK(contains(error, problem));
        LoadOptions lenient;
        lenient.lenient = true;
        const Scene s = load_pbrt_world(world, lenient);
        REQUIRE(s.warnings.size() == 1);
        CHECK(contains(s.warnings[0], problem));
    }
    CHECK(contains(pbrt_error("Camera \"realistic\" WorldBegin"), "scene.pbrt:1: camera 'realistic' is not supported"));
}

TEST_CASE("errors say where") {
    const std::vector<std::pair<std::string, std::string>> cases = {
        {"Frobnicate", "unknown directive 'Frobnicate'"},
        {"Shape sphere", "must be a string in quotes"},
        {"Shape \"sphere", "the string that begins here has no end"},
        {"Shape \"sphere\" \"radius\" 1", "is no parameter"},
        {"Shape \"sphere\" \"double radius\" 1", "unknown type 'double'"},
        {"Shape \"sphere\" \"float radius\" [1", "has no end"},
        {"Shape \"sphere\" \"float radius\"", "has no value"},
        {"Shape \"sphere\" \"float radius\" \"1\"", "is no value of type float"},
        {"Shape \"sphere\" \"float radius\" [1 2]", "must be one number"},
        {"Shape \"sphere\" \"float radius\" -1", "radius must be positive"},
        {"Shape \"sphere\" \"float radius\" 1 \"float radius\" 1", "is given twice"},
        {"Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]",
         "index 3 of 3 vertices"},
        {"Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1] \"integer indices\" [0 1 2]", "no multiple of 3"},
        {"Translate 1 2 x", "must be a number, not 'x'"},
        {"Scale 0 1 1 Shape \"sphere\"", "singular"},
        {"AttributeEnd", "AttributeEnd without AttributeBegin"},
        {"AttributeBegin", "AttributeBegin has no end"},
        {"ObjectBegin \"a\"", "ObjectBegin has no end"},
        {"ObjectInstance \"a\"", "unknown object 'a'"},
        {"NamedMaterial \"a\" Shape \"sphere\"", "unknown material 'a'"},
        {"CoordSysTransform \"a\"", "unknown coordinate system 'a'"},
        {"ColorSpace \"a\"", "unknown colour space 'a'"},
        {"Include \"none.pbrt\"", "file 'none.pbrt' does not exist"},
        {"Include \"scene.pbrt\"", "circular include"},
        {"Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\"",
         "no texture of type spectrum is known by the name 't'"},
        {"Material \"diffuse\" \"rgb reflectance\" [1 -1 0] Shape \"sphere\"", "is negative"},
        {"MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"m\" \"m\"] NamedMaterial \"m\" Shape "
         "\"sphere\"",
         "a mix of itself"},
        {"Transform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 0]", "must be a number"},
        {"LightSource \"spot\" \"float coneangle\" 95", "between 0 and 90"},
        {"LightSource \"point\" \"spectrum I\" [400 1]", "two pairs"},
        {"Film \"rgb\"", "must stand before WorldBegin"},
    };
    for (const auto& [world, problem] : cases) {
        INFO(world);
        const std::string error = world_error(world);
        CHECK(contains(error, "scene.pbrt:"));
        CHECK(contains(error, problem));
    }
    CHECK(contains(pbrt_error("Shape \"sphere\""), "Shape must stand behind WorldBegin"));
    CHECK(contains(pbrt_error(""), "has no WorldBegin"));
}

TEST_CASE("files that nest, unpack or repeat stay within the limits") {
    const TempFolder folder;
    LoadOptions options;
    options.limits.nesting = 20;
    options.limits.includes = 50;
    options.limits.shapes = 100;
    options.limits.bytes = 1 << 20;
    std::string deep = "WorldBegin ", many = "WorldBegin ObjectBegin \"o\" ";
    for (int i = 0; i < 30; ++i) deep += "AttributeBegin ";
    CHECK(contains(pbrt_error(deep, options), "nested deeper than --limits nesting=20"));
    for (int i = 0; i < 20; ++i) many += "Shape \"sphere\" ";
    many += "ObjectEnd ";
    for (int i = 0; i < 20; ++i) many += "ObjectInstance \"o\" ";
    CHECK(contains(pbrt_error(many, options), "--limits shapes=100"));
    folder.write("bomb.pbrt.gz", gzip(std::string(2 << 20, ' ')));
    CHECK(contains(pbrt_error("Include \"bomb.pbrt.gz\"", options, &folder), "--limits bytes"));
    folder.write("cut.pbrt.gz", gzip(std::string(1000, 'x') + "abc").substr(0, 20));
    CHECK(contains(pbrt_error("Include \"cut.pbrt.gz\"", options, &folder), "gzip file is cut off"));
    std::string includes;
    folder.write("one.pbrt", "");
    for (int i = 0; i < 60; ++i) includes += "Include \"one.pbrt\" ";
    CHECK(contains(pbrt_error(includes, options, &folder), "--limits includes=50"));
    // Whatever a file is cut off at, it is refused or complete.
    const std::string text =
        "WorldBegin AttributeBegin Material \"diffuse\" \"rgb reflectance\" [.5 .5 .5] " + kTriangle + "AttributeEnd";
    for (size_t n = 0; n < text.size(); ++n) CHECK(pbrt_error(text.substr(0, n), options) != "");
}

TEST_CASE("parts of spheres, disks and cylinders are meshes") {
    const auto check = [](const std::string& shape, double area, auto lies_on_it) {
        INFO(shape);
        const Scene s = load_pbrt_world(shape);
        REQUIRE(s.shapes.size() == 1);
        CHECK(s.quadrics.empty());
        CHECK(s.shapes[0].area == Approx(area).epsilon(2e-4));
        for (const MeshVertex& v : s.vertices) {
            CHECK(lies_on_it(v));
            CHECK(length(v.n) == Approx(1));
        }
        CHECK(has_note(s, "are triangles"));
    };
    check("Shape \"sphere\" \"float radius\" 2 \"float zmin\" -1 \"float zmax\" 1.5 \"float phimax\" 270",
          1.5 * M_PI * 2 * 2.5, [](const MeshVertex& v) {
              const float phi = std::atan2(v.p.y, v.p.x);
              return std::fabs(length(v.p) - 2) < 1e-5f && v.p.z > -1.0001f && v.p.z < 1.5001f &&
                     dot(v.p, v.n) > 1.999f && !(phi > -0.999f * float(M_PI / 2) && phi < -0.001f);
          });
    check("Shape \"disk\" \"float innerradius\" 0.5 \"float height\" 3", M_PI * 0.75, [](const MeshVertex& v) {
        const float r = std::hypot(v.p.x, v.p.y);
        return v.p.z == 3 && r > 0.499f && r < 1.001f && v.n.z == 1;
    });
    check("Shape \"cylinder\" \"float zmin\" 1 \"float zmax\" 2 \"float phimax\" 90", M_PI / 2,
          [](const MeshVertex& v) {
              return v.p.x > -1e-6f && v.p.y > -1e-6f && v.p.z >= 1 && v.p.z <= 2 &&
                     v.n.x * v.p.x + v.n.y * v.p.y > 0.999f;
          });
    // Outside of the file's orientation.
    const Scene turned = load_pbrt_world("ReverseOrientation Shape \"sphere\" \"float zmin\" 0");
    CHECK(dot(turned.vertices[0].p, turned.vertices[0].n) < -0.99f);
    CHECK(load_pbrt_world("Shape \"sphere\" \"float zmin\" -1 \"float zmax\" 1 \"float phimax\" 360").quadrics.size() ==
          1);
    CHECK(contains(world_error("Shape \"disk\" \"float innerradius\" 1"), "innerradius must be less than radius"));
}

TEST_CASE("stretched spheres and cylinders are meshes, with their normals") {
    const auto load_stretched = [](const std::string& world) {
        const Scene s = load_pbrt_world(world);
        CHECK(s.quadrics.empty());
        CHECK(has_note(s, "stretched spheres and cylinders are triangles"));
        return s;
    };
    const Scene egg = load_stretched("Scale 3 0.5 1 Shape \"sphere\" \"float radius\" 2");
    for (const MeshVertex& v : egg.vertices) {
        const Vec3f unit = {v.p.x / 6, v.p.y / 1, v.p.z / 2}, n = normalize({v.p.x / 36, v.p.y, v.p.z / 4});
        CHECK(length(unit) == Approx(1).epsilon(1e-5));
        CHECK(dot(n, v.n) > 0.9999f);
    }
    load_stretched("Scale 1 2 1 Shape \"cylinder\"");
    load_stretched("ConcatTransform [1 0 0 0  0.5 1 0 0  0 0 1 0  0 0 0 1] Shape \"sphere\"");
    for (const char* world : {"Scale 2 2 5 Shape \"cylinder\"", "Scale -2 2 2 Rotate 40 1 2 3 Shape \"sphere\"",
                              "Scale 1 2 1 Shape \"disk\""})
        CHECK(load_pbrt_world(world).quadrics.size() == 1);
}

TEST_CASE("WorldEnd may end a file, with a note") {
    CHECK(has_note(load_pbrt_world(kSphere + "WorldEnd # of pbrt-v3"), "WorldEnd is of older versions"));
    CHECK(contains(world_error(kSphere + "WorldEnd\n" + kSphere), "unknown directive 'WorldEnd'"));
}

TEST_CASE("several infinite lights are one") {
    const TempFolder folder;
    write_float_image(folder / "sky.exr", 4, 4, std::vector<float>(48, 2.0f));
    const std::string map = "LightSource \"infinite\" \"string filename\" \"sky.exr\" \"float scale\" 0.5 ",
                      constant = "LightSource \"infinite\" \"rgb L\" [0.25 0.5 0.75] ";
    const Scene two = load_pbrt_world(constant + constant, {}, &folder);
    REQUIRE(two.emitters.size() == 1);
    check_rgb(two.emitters[0].radiance.value, {0.5f, 1, 1.5f});
    for (const std::string& lights : {map + constant, constant + map}) {
        const Scene s = load_pbrt_world(lights, {}, &folder);
        REQUIRE(s.emitters.size() == 1);
        CHECK(s.emitters[0].type == EmitterType::envmap);
        const Rgb texel = load_texel(s.view(), s.textures[size_t(s.emitters[0].radiance.texture)], 1, 1);
        check_rgb(s.emitters[0].radiance.value * texel, {1.25f, 1.5f, 1.75f}, 1e-3);
    }
    CHECK(contains(pbrt_error("WorldBegin " + map + map, {}, &folder), "two infinite lights with images"));
}

TEST_CASE("textures of textures on one grid") {
    const TempFolder folder;
    write_float_image(folder / "wide.exr", 4, 1, {0, 0, 0, .2f, .2f, .2f, .4f, .4f, .4f, .6f, .6f, .6f});
    write_float_image(folder / "tall.exr", 1, 2, {1, 1, 1, .5f, .5f, .5f});
    const auto image = [](const std::string& name, const std::string& file, const std::string& more = "") {
        return "Texture \"" + name + "\" \"spectrum\" \"imagemap\" \"string filter\" \"point\" \"string filename\" \"" +
               file + "\" " + more;
    };
    const auto shown = [&](const std::string& textures) {
        return load_pbrt_world(
            textures +
                " Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"trianglemesh\" \"point3 P\" "
                "[0 0 0 1 0 0 1 1 0] \"integer indices\" [0 1 2] \"point2 uv\" [0 0 1 0 1 1]",
            {}, &folder);
    };
    const std::string both = image("a", "wide.exr") + image("b", "tall.exr");
    const Scene mixed = shown(
        both + "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"texture tex2\" \"b\" \"float amount\" .25");
    CHECK(has_note(mixed, "one grid of texels"));
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x) {
            const Vec2f uv = {(float(x) + 0.5f) / 4, (float(y) + 0.5f) / 2};  // v = 0 is the last row of a file
            CHECK(reflectance(mixed, 0, uv).x == Approx(0.75 * 0.2 * x + 0.25 * (y ? 1 : 0.5)));
        }
    // A checkerboard of 4 by 4 cells, of an image and a colour.
    const std::string board =
        "Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 4 "
        "\"texture tex1\" \"a\" \"rgb tex2\" [.9 .9 .9]";
    const Scene checkered = shown(image("a", "wide.exr") + board);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x)
            CHECK(reflectance(checkered, 0, {(float(x) + 0.4f) / 4, (float(y) + 0.4f) / 4}).x ==
                  Approx((x + y) % 2 == 0 ? 0.2 * x : 0.9));
    CHECK(contains(pbrt_error("WorldBegin " + image("a", "wide.exr", "\"float uscale\" 1.5 ") + image("b", "tall.exr") +
                                  "Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"a\" \"texture scale\" \"b\"",
                              {}, &folder),
                   "no texture of type float"));
    CHECK(contains(pbrt_error("WorldBegin " + image("a", "wide.exr", "\"float uscale\" 1.5 ") + image("b", "tall.exr") +
                                  "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"texture tex2\" \"b\"",
                              {}, &folder),
                   "whose periods do not fit"));
    const Scene corners = shown(
        "Texture \"t\" \"spectrum\" \"bilerp\" \"rgb v00\" [0 0 0] \"rgb v10\" [.4 .4 .4] \"rgb v01\" "
        "[.8 .8 .8] \"rgb v11\" [1 1 1]");
    for (float u : {0.0f, 0.3f, 1.0f})
        for (float v : {0.0f, 0.7f, 1.0f})
            CHECK(reflectance(corners, 0, {u, v}).x ==
                  Approx((1 - v) * u * 0.4 + v * ((1 - u) * 0.8 + u)).margin(1e-5));

    // Centres by Perlin's noise, computed by a program of its own.
    const Scene dots = shown(
        "Texture \"t\" \"spectrum\" \"dots\" \"float uscale\" 4 \"float vscale\" 4 \"float vdelta\" 1 "
        "\"rgb inside\" [1 .5 0] \"rgb outside\" [0 .25 1]");
    CHECK(has_note(dots, "dots are an image of 256 texels a side"));
    const auto at = [&](double x, double y) { return reflectance(dots, 0, {float(x / 4), float((y - 1) / 4)}); };
    const Vec2f centres[] = {{1.1132f, 2.0119f}, {2.0509f, 2.9011f}, {3.0247f, 3.9469f}};
    for (const Vec2f c : centres)
        for (int k = 0; k < 8; ++k) {
            const double x = std::cos(k * M_PI / 4), y = std::sin(k * M_PI / 4);
            check_rgb(at(c.x + 0.32 * x, c.y + 0.32 * y), {1, 0.5f, 0});
            check_rgb(at(c.x + 0.38 * x, c.y + 0.38 * y), {0, 0.25f, 1});
        }
    check_rgb(at(1, 4), {0, 0.25f, 1});
    check_rgb(at(2, 1.3), {0, 0.25f, 1});
}

TEST_CASE("curves are tubes, those of one material in one mesh") {
    const std::string curve = "Shape \"curve\" \"string type\" \"cylinder\" \"float width\" 0.2 ";
    const Scene s = test::load_pbrt_world(
        curve + "\"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]\n" + curve +
        "\"point3 P\" [0 1 0 1 1 0 2 1 0] \"integer degree\" 2\n" + curve +
        "\"string basis\" \"bspline\" \"point3 P\" [-1 2 0 0 2 0 1 2 0 2 2 0] \"float width1\" 0.4\n"
        "Material \"conductor\"\n" +
        curve + "\"point3 P\" [0 3 0 1 3 0 2 3 0 3 3 0]\n");
    REQUIRE(s.shapes.size() == 2);
    // Areas of open tubes: circumference times length; the last of the first mesh is a cone.
    const double slant = std::sqrt(1 + 0.1 * 0.1);
    CHECK(s.shapes[0].area == Approx(2 * M_PI * (0.1 * 3 + 0.1 * 2 + 0.15 * slant)).epsilon(0.005));
    CHECK(s.shapes[1].area == Approx(2 * M_PI * 0.1 * 3).epsilon(0.005));
    float most = 0;
    for (uint32_t i = 0; i < s.shapes[0].primitive_count; ++i) most = std::max(most, s.vertices[s.triangles[i].v2].p.x);
    CHECK(most == Approx(3).margin(1e-5));
    CHECK(test::contains(test::pbrt_error("WorldBegin\n" + curve + "\"point3 P\" [0 0 0 1 0 0 2 0 0]\n"),
                         "3 control points do not make a curve of degree 3"));
}

TEST_CASE("attributes of materials count for named ones too") {
    const auto alpha = [](const std::string& material) {
        const Scene s =
            load_pbrt_world("Attribute \"material\" \"float roughness\" 0.04 " + material + " Shape \"sphere\"");
        const BsdfRecord& r = s.bsdfs[s.materials[s.shapes[0].material].front];
        REQUIRE(r.type == BsdfType::rough_conductor);
        return r.as<RoughConductor>().alpha_u.value;
    };
    CHECK(alpha("Material \"conductor\"") == Approx(0.2));
    CHECK(alpha("MakeNamedMaterial \"m\" \"string type\" \"conductor\" NamedMaterial \"m\"") == Approx(0.2));
    CHECK(alpha("MakeNamedMaterial \"m\" \"string type\" \"conductor\" \"float roughness\" .09 NamedMaterial \"m\"") ==
          Approx(0.3));
}

TEST_CASE("a light of alpha 0 shines unseen; what is no light is gone") {
    const auto load = [](const std::string& alpha, const std::string& light) {
        return load_pbrt_world(light + "Shape \"sphere\" " + alpha);
    };
    const std::string light = "AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] ";
    const auto type = [](const Scene& s) { return s.emitters.at(0).type; };
    const auto opacity = [](const Scene& s) { return s.materials[s.shapes[0].material].opacity.value; };
    const Scene unseen = load("\"float alpha\" 0", light), seen = load("\"float alpha\" .5", light);
    CHECK(type(unseen) == EmitterType::hidden_area);
    CHECK(opacity(unseen) == 0);
    CHECK(unseen.emitters[0].radiance.value == load("", light).emitters[0].radiance.value);
    CHECK(unseen.emitters[0].pick_probability == 1);
    CHECK(type(seen) == EmitterType::area);
    CHECK(opacity(seen) == 0.5f);
    const Scene none = load("\"float alpha\" 0", "");
    CHECK(none.emitters.empty());
    CHECK(opacity(none) == 0);
    // From a texture too, of a mesh, to both sides.
    const Scene s = load_pbrt_world(
        "Texture \"zero\" \"float\" \"constant\" \"float value\" 0\n"
        "AreaLightSource \"diffuse\" \"bool twosided\" true Material \"dielectric\" "
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] \"texture alpha\" "
        "\"zero\"");
    REQUIRE(s.emitters.size() == 2);
    for (const Emitter& e : s.emitters) CHECK(e.type == EmitterType::hidden_area);
}

TEST_CASE("alpha covers what a light emits, too") {
    const auto load = [](const std::string& before, const std::string& alpha,
                         const std::string& L = "\"rgb L\" [1 2 3]") {
        return load_pbrt_world(before + "AreaLightSource \"diffuse\" " + L +
                               " Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] " +
                               "\"point2 uv\" [0 0 4 0 0 4] " + alpha);
    };
    const ParamRgb full = load("", "").emitters.at(0).radiance;
    CHECK(load("", "\"float alpha\" .25").emitters.at(0).radiance.value == full.value * 0.25f);
    CHECK(load("", "\"float alpha\" 3").emitters.at(0).radiance.value == full.value);
    const Scene s = load("Texture \"m\" \"float\" \"checkerboard\" \"float tex1\" 1 \"float tex2\" .5\n",
                         "\"texture alpha\" \"m\"");
    const Emitter& e = s.emitters.at(0);
    REQUIRE(e.radiance.texture >= 0);
    const auto at = [&](float u, float v) { return eval_rgb<kAllFeatures>(s.view(), e.radiance, {u, v}); };
    CHECK(max_component(abs(at(0.5f, 0.5f) - full.value)) < 1e-3f);
    CHECK(max_component(abs(at(1.5f, 0.5f) - full.value * 0.5f)) < 1e-3f);
}

TEST_CASE("faces of ptex and tangents of meshes are left out") {
    const Scene s = load_pbrt_world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] \"integer faceIndices\" "
        "[0] "
        "\"vector3 S\" [1 0 0 1 0 0 1 0 0]");
    CHECK(s.triangles.size() == 1);
}
