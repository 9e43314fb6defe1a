// libs: ambilux_formats ZLIB::ZLIB
// timeout: 60
// What pbrt scenes become, what is refused and how, and files that lie.
#include <zlib.h>

#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"
#include "transport/sensor/camera.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

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

TEST_CASE("a name that is nearly one of pbrt's is told with it") {
    const std::vector<std::pair<std::string, std::string>> cases = {
        {"Materal \"diffuse\"", "unknown directive 'Materal': 'Material' is known"},
        {"Material \"difuse\" Shape \"sphere\"", "material 'difuse' is not supported: 'diffuse' is known"},
        {"Shape \"spere\"", "shape 'spere' is not supported: 'sphere' is known"},
        {"Shape \"sphere\" \"float raduis\" 2", "unknown parameter 'raduis' of Shape 'sphere': 'radius' is known"},
        {"Material \"diffuse\" \"rgb reflektance\" [1 1 1] Shape \"sphere\"",
         "'reflektance' of Material 'diffuse': 'reflectance' is known"},
        {"MakeNamedMaterial \"Red\" \"string type\" \"diffuse\" NamedMaterial \"red\" Shape \"sphere\"",
         "unknown material 'red': 'Red' is known"},
        {"ObjectBegin \"tree\" ObjectEnd ObjectInstance \"trees\"", "unknown object 'trees': 'tree' is known"},
        {"Texture \"wood\" \"float\" \"constant\" Material \"conductor\" \"texture roughness\" \"wod\" Shape "
         "\"sphere\"",
         "is known by the name 'wod': 'wood' is known"},
        {"LightSource \"pont\"", "light 'pont' is not supported: 'point' is known"},
        {"Texture \"t\" \"float\" \"image\"", "texture type 'image' is not supported"},
        {"Texture \"t\" \"float\" \"checkboard\"",
         "texture type 'checkboard' is not supported: 'checkerboard' is known"},
        {"Shape \"plymesh\" \"string filenam\" \"a.ply\"",
         "unknown parameter 'filenam' of Shape 'plymesh': 'filename' is known"},
        {"Shape \"plymesh\"", "scene.pbrt:2: Shape 'plymesh' has no filename"},
        {"Texture \"t\" \"float\" \"imagemap\"", "Texture 'imagemap' has no filename"},
    };
    for (const auto& [text, message] : cases) CHECK_THAT(world_error(text), ContainsSubstring(message));
    const std::vector<std::pair<std::string, std::string>> options = {
        {"Camera \"perspectiv\"", "camera 'perspectiv' is not supported: 'perspective' is known"},
        {"PixelFilter \"gauss\"", "filter 'gauss' is not supported"},
        {"PixelFilter \"triangel\"", "filter 'triangel' is not supported: 'triangle' is known"},
        {"Film \"rgbb\"", "film 'rgbb' is not supported: 'rgb' is known"},
        {"Sampler \"zsobl\"", "sampler 'zsobl' is not supported: 'zsobol' is known"},
        {"Film \"rgb\" \"integer xresolutoin\" 8",
         "unknown parameter 'xresolutoin' of Film 'rgb': 'xresolution' is known"},
        {"Sampler \"sobol\" \"integer pixelsample\" 8",
         "unknown parameter 'pixelsample' of Sampler 'sobol': 'pixelsamples' is known"},
        {"Integrator \"vlpath\"", "integrator 'vlpath' is not supported: 'volpath' is known"},
    };
    for (const auto& [text, message] : options)
        CHECK_THAT(pbrt_error(text + " WorldBegin Shape \"sphere\""), ContainsSubstring(message));
}

TEST_CASE("what a film or a sampler asks for and does not get is told") {
    const auto notes_of = [](const std::string& option) { return load_pbrt_text(option + " WorldBegin").notes; };
    const size_t plain = notes_of("").size();
    const std::vector<std::pair<std::string, std::string>> told = {
        {"Film \"gbuffer\"", "film 'gbuffer' gets the channels of rgb"},
        {"Film \"gbuffer\" \"string coordinatesystem\" \"world\"",
         "'coordinatesystem' of Film 'gbuffer' is not followed"},
        {"Film \"spectral\" \"integer nbuckets\" 8", "'nbuckets' of Film 'spectral' is not followed"},
        {"Film \"rgb\" \"float diagonal\" 20", "'diagonal' of Film 'rgb' is not followed"},
        {"Film \"rgb\" \"float maxcomponentvalue\" 20", "samples are not clamped"},
        {"Sampler \"halton\"", "sampler 'halton' is not followed; samples are independent"},
        {"Sampler \"independent\" \"integer seed\" 3", "'seed' of Sampler 'independent' is not followed"},
    };
    for (const auto& [option, note] : told) CHECK(has_note(load_pbrt_text(option + " WorldBegin"), note));
    for (const char* option : {"Film \"rgb\" \"string filename\" \"a.exr\" \"bool savefp16\" false",
                               "Sampler \"independent\" \"integer pixelsamples\" 3"})
        CHECK(notes_of(option).size() == plain);
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
    const TempFolder folder;
    folder.write("wrong.pbrt", "\nShape \"ball\"");
    const std::string error = pbrt_error("WorldBegin\nInclude \"wrong.pbrt\"", {}, &folder);
    CHECK(contains(error, "wrong.pbrt:2: shape 'ball' is not supported"));
    CHECK(contains(error, "scene.pbrt:2)"));
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
    folder.write("cut.pbrt.gz", gzip(std::string(1003, 'x')).substr(0, 20));
    CHECK(contains(pbrt_error("Include \"cut.pbrt.gz\"", options, &folder), "gzip file is cut off"));
    std::string includes;
    folder.write("one.pbrt", "");
    for (int i = 0; i < 60; ++i) includes += "Include \"one.pbrt\" ";
    CHECK(contains(pbrt_error(includes, options, &folder), "--limits includes=50"));
    // Whatever a file is cut off at, it is refused or complete.
    const std::string text = "WorldBegin AttributeBegin Material \"diffuse\" \"rgb reflectance\" [.5 .5 .5] " +
                             kUnitTriangle + "AttributeEnd";
    for (size_t n = 0; n < text.size(); ++n) CHECK(pbrt_error(text.substr(0, n), options) != "");
}

TEST_CASE("WorldEnd may end a file, with a note") {
    CHECK(has_note(load_pbrt_world(kUnitSphere + "WorldEnd # of pbrt-v3"), "WorldEnd is of older versions"));
    CHECK(contains(world_error(kUnitSphere + "WorldEnd\n" + kUnitSphere), "unknown directive 'WorldEnd'"));
}
