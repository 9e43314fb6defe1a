// libs: ambilux_formats ZLIB::ZLIB JPEG::JPEG
// timeout: 120
// Scene and mesh files that lie, nest, expand or lie outside of what can be traced.
#include <zlib.h>

#include <chrono>
#include <cstring>

#include "core/error.h"
#include "formats/load.h"
#include "formats/meshes/mesh.h"
#include "tests/support/catch.h"
#include "tests/support/image_files.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;

namespace {

const std::string kSensor = "<sensor type='perspective'/>";

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::string wrap(const std::string& body, const std::string& version = "3.0.0") {
    return "<scene version='" + version + "'>\n" + body + "\n</scene>\n";
}

std::string error_of(const test::TempFolder& folder, const std::string& text, const LoadOptions& options = {}) {
    try {
        load_mitsuba(folder.write("scene.xml", text), options);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

/// Of a scene with this body and a sensor, unless it has one.
std::string body_error(const std::string& body, const LoadOptions& options = {}) {
    const test::TempFolder folder;
    return error_of(folder, wrap(contains(body, "<sensor") ? body : body + kSensor), options);
}

template <class F>
std::string mesh_error(const F& f) {
    try {
        f();
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

std::string repeat(const std::string& text, size_t count) {
    std::string all;
    for (size_t i = 0; i < count; ++i) all += text;
    return all;
}

std::string file_name(size_t i) { return std::string("i").append(std::to_string(i)).append(".xml"); }

}  // namespace

TEST_CASE("a PLY file with two elements of vertices is refused, and so are fractions as indices") {
    const std::string xyz = "property float x\nproperty float y\nproperty float z\n",
                      n = "property float nx\nproperty float ny\nproperty float nz\n",
                      face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const auto error = [](const std::string& text) {
        return mesh_error([&] { read_ply("m.ply", "ply\nformat ascii 1.0\n" + text, false); });
    };
    CHECK(contains(error("element vertex 1\n" + xyz + n + "element vertex 2\n" + xyz + face +
                         "0 0 0 0 0 1\n1 0 0\n0 1 0\n3 0 1 2\n"),
                   "m.ply:10: element 'vertex' is declared twice"));
    const std::string three = "element vertex 3\n" + xyz + face + "0 0 0\n1 0 0\n0 1 0\n";
    CHECK(error(three + "3 0 1 2\n") == "no error");
    CHECK(contains(error(three + "3 0 1 1.9\n"), "'1.9' is no index or count"));
    CHECK(contains(error(three + "3 0 1 nan\n"), "'nan' is no index or count"));
    CHECK(contains(error(three + "1e300 0 1 2\n"), "'1e+300' is no index or count"));
    // The check that all readers share.
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.faces = {{0, 1, 2}};
    mesh.normals = {{0, 0, 1}};
    CHECK(contains(mesh_error([&] { check_mesh("m", mesh); }), "given for 1 of 3 vertices"));
    mesh.normals.clear();
    mesh.uvs = {{0, 0}};
    CHECK(contains(mesh_error([&] { check_mesh("m", mesh); }), "given for 1 of 3 vertices"));
}

TEST_CASE("an OBJ file that is empty or random is no mesh") {
    for (const std::string text : {"", "# nothing\n", "v 1 2 3\nv 1 2 4\n", "\x01\x80\xff\n\x7f zz 3 4\n"})
        CHECK(contains(mesh_error([&] { read_obj("m.obj", text, true); }), "m.obj: the mesh has no faces"));
}

TEST_CASE("meshes of more than the limits are refused before they are read") {
    Limits limits;
    limits.bytes = 1000;
    const std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + repeat("f 1 2 3\n", 200);
    CHECK(mesh_error([&] { read_obj("m.obj", text, true); }) == "no error");
    CHECK(contains(mesh_error([&] { read_obj("m.obj", text, true, limits); }), "--limits bytes=1000"));
    // A mesh of zeros that deflate packs a thousand times.
    std::string raw(4 + 1, '\0');
    raw[1] = '\x10';
    const uint64_t counts[2] = {3u << 20, 1};
    raw.append(reinterpret_cast<const char*>(counts), sizeof counts);
    raw.append(counts[0] * 12 + 12, '\0');
    uLongf size = compressBound(uLong(raw.size()));
    std::string packed(size, '\0');
    REQUIRE(compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
                     uLong(raw.size())) == Z_OK);
    std::string file = std::string("\x1c\x04\x04\x00", 4) + packed.substr(0, size);
    const uint64_t offset = 0;
    const uint32_t count = 1;
    file.append(reinterpret_cast<const char*>(&offset), 8).append(reinterpret_cast<const char*>(&count), 4);
    CHECK(file.size() < 100000);
    CHECK(mesh_error([&] { read_serialized("m", file, 0, false); }) == "no error");
    limits.bytes = 1 << 20;
    CHECK(contains(mesh_error([&] { read_serialized("m", file, 0, false, limits); }), "--limits bytes=1048576"));
}

TEST_CASE("nesting ends at the limit: elements, includes, references") {
    const size_t deep = 20000;
    CHECK(contains(body_error(repeat("<bsdf type='twosided'>", deep) + repeat("</bsdf>", deep)),
                   "elements are nested deeper than --limits nesting=256"));
    std::string chain = "<bsdf type='diffuse' id='b0'/>";
    for (size_t i = 1; i < deep; ++i)
        chain +=
            "<bsdf type='twosided' id='b" + std::to_string(i) + "'><ref id='b" + std::to_string(i - 1) + "'/></bsdf>";
    CHECK(contains(body_error(chain), "references are nested deeper than --limits nesting=256"));
    const test::TempFolder folder;
    for (size_t i = 0; i < 300; ++i) folder.write(file_name(i), wrap("<include filename='" + file_name(i + 1) + "'/>"));
    folder.write("i300.xml", wrap(""));
    CHECK(contains(error_of(folder, wrap(kSensor + "<include filename='i0.xml'/>")), "--limits nesting=256"));
}

TEST_CASE("what doubles at every step is refused: includes, parameters, references") {
    const test::TempFolder folder;
    for (size_t i = 0; i < 40; ++i)
        folder.write(file_name(i), wrap(repeat("<include filename='" + file_name(i + 1) + "'/>", 2)));
    folder.write("i40.xml", wrap(""));
    CHECK(contains(error_of(folder, wrap(kSensor + "<include filename='i0.xml'/>")), "--limits includes=1000"));

    std::string defaults = "<default name='p0' value='0123456789'/>";
    for (int i = 1; i <= 40; ++i) {
        const std::string earlier = "$p" + std::to_string(i - 1) + " ";
        defaults += "\n<default name='p" + std::to_string(i) + "' value='" + earlier + earlier + "'/>";
    }
    CHECK(contains(body_error(defaults), "parameters expand to more characters than --limits expansion=67108864"));

    std::string groups = "<shape type='shapegroup' id='g0'><shape type='sphere'/></shape>";
    for (int i = 1; i <= 40; ++i) {
        const std::string ref = "<ref id='g" + std::to_string(i - 1) + "'/>";
        groups += "<shape type='shapegroup' id='g" + std::to_string(i) + "'>" + ref + ref + "</shape>";
    }
    CHECK(contains(body_error(groups), "more objects"));

    std::string mixes = "WorldBegin\nMakeNamedMaterial \"m0\" \"string type\" \"diffuse\"\n";
    for (int i = 1; i <= 40; ++i) {
        const std::string earlier = " \"m" + std::to_string(i - 1) + "\"";
        mixes += "MakeNamedMaterial \"m" + std::to_string(i) + "\" \"string type\" \"mix\" \"string materials\" [" +
                 earlier + earlier + " ]\n";
    }
    const std::string pbrt = folder.write("scene.pbrt", mixes + "NamedMaterial \"m40\"\nShape \"sphere\"\n");
    CHECK(contains(mesh_error([&] { load_pbrt(pbrt); }), "more objects"));
    LoadOptions options;
    options.limits.shapes = 10;
    CHECK(contains(body_error(repeat("<shape type='sphere'/>\n", 11), options),
                   "scene.xml:12: the scene has more shapes than --limits shapes=10"));
    options = {};
    options.limits.total_bytes = 1000;
    CHECK(contains(body_error(repeat("<shape type='cube'/>", 2), options), "--limits total_bytes=1000"));
}

TEST_CASE("the version must be known") {
    const test::TempFolder folder;
    for (const std::string version : {"-5", "4.0.0", "x", ""})
        CHECK(contains(error_of(folder, wrap(kSensor, version)), "is no version that is known"));
    for (const std::string version : {"0.5.0", "0.6.0", "2.1.0", "3.7.1"})
        CHECK(error_of(folder, wrap(kSensor, version)) == "no error");
}

TEST_CASE("what cannot be traced is refused by shape, emitter or sensor with its line") {
    const auto moved = [](const std::string& x) {
        return "<transform name='to_world'><translate x='" + x + "'/></transform>";
    };
    // Something at the origin keeps the scene from being moved there.
    const std::string here = "<shape type='sphere'/>\n";
    const std::string range = "; rays are traced between -1e+17 and 1e+17";
    const std::pair<std::string, std::string> cases[] = {
        {here + "<shape type='rectangle'>" + moved("1e19") + "</shape>",
         "scene.xml:3: the shape of type 'rectangle' reaches to 1e+19" + range},
        {here + "<shape type='sphere'>" + moved("1e19") + "</shape>",
         "scene.xml:3: the shape of type 'sphere' reaches"},
        {here + "<shape type='cylinder'><point name='p1' x='0' y='0' z='1e20'/></shape>", "type 'cylinder' reaches"},
        {here + "<shape type='disk'><transform name='to_world'><scale value='1e18'/></transform></shape>",
         "type 'disk' reaches"},
        {here + "<shape type='cube'><transform name='to_world'><scale value='1e60'/></transform></shape>",
         "type 'cube' reaches to -"},
        {here + "<emitter type='point'><point name='position' x='0' y='-1e25' z='0'/></emitter>",
         "scene.xml:3: the emitter of type 'point' reaches to -1e+25" + range},
        {here + "<emitter type='spot'>" + moved("1e25") + "</emitter>", "the emitter of type 'spot' reaches"},
        {here + "<sensor type='perspective'>" + moved("1e19") + "</sensor>", "the sensor reaches to 1e+19"},
        {"<sensor type='thinlens'>\n<float name='aperture_radius' value='1e20'/></sensor>",
         "scene.xml:3: aperture_radius is 1e+20; it may be 1e+17 at most"},
        {"<sensor type='thinlens'><float name='aperture_radius' value='1e10'/><float name='focus_distance' "
         "value='1e-10'/></sensor>",
         "rays of the sensor leave its axis by 1e+20 times their way"},
        {"<sensor type='perspective'>\n<float name='near_clip' value='1e20'/><float name='far_clip' "
         "value='1e30'/></sensor>",
         "scene.xml:3: near_clip is 1e+20"},
        {"<sensor type='perspective'><float name='fov' value='179.99'/><float name='near_clip' value='9e16'/><float "
         "name='far_clip' value='1e30'/></sensor>",
         "rays of the sensor begin up to"},
        {"<sensor type='perspective'><float name='fov' value='1e-30'/></sensor>", "half the field of view"},
        {"<sensor type='perspective'><string name='focal_length' value='1e-40mm'/></sensor>", "half the field of view"},
        {"<shape type='sphere'><float name='radius' value='1e-30'/></shape>", "is 1e-30 wide, less than 1e-17"},
        {here + "<shape type='rectangle'><transform name='to_world'><scale value='1e-80'/><translate "
                "x='1'/></transform></shape>",
         "scene.xml:3: the shape of type 'rectangle' has no area"},
    };
    for (const auto& [body, expected] : cases) {
        const std::string message = body_error(body);
        CAPTURE(body, message);
        CHECK(contains(message, expected));
    }
    // A scene that lies far away as a whole is moved to the origin.
    CHECK(body_error("<sensor type='perspective'>" + moved("1e18") +
                     "</sensor><shape type='sphere'><transform "
                     "name='to_world'><scale value='1e10'/><translate x='1e18'/></transform></shape>") == "no error");
    // Floats leave nothing of the rectangle where it is, but enough where it is moved to.
    CHECK(body_error("<sensor type='perspective'>" + moved("1e9") +
                     "</sensor><shape type='sphere'><float "
                     "name='radius' value='1e6'/>" +
                     moved("1e9") + "</shape><shape type='rectangle'>" + moved("1e9") + "</shape>") == "no error");
}

TEST_CASE("values that only doubles hold are refused with their line") {
    const test::TempFolder folder;
    folder.write("e.hdr", test::hdr_header(2, 1) + test::rgbe(4, 4, 4) + test::rgbe(1, 1, 1));
    const auto environment = [&](const std::string& scale) {
        return error_of(folder, wrap(kSensor +
                                     "<emitter type='envmap'><string name='filename' value='e.hdr'/>\n<float "
                                     "name='scale' value='" +
                                     scale + "'/></emitter>"));
    };
    CHECK(contains(environment("1e38"), "scene.xml:3: scale 1e+38 makes a radiance of 4e+38"));
    CHECK(contains(environment("1e300"), "scene.xml:3: scale 1e+300"));
    CHECK(environment("1e37") == "no error");
    CHECK(contains(body_error("<shape type='sphere'><bsdf type='roughconductor'>\n<float name='alpha' "
                              "value='1e300'/></bsdf></shape>"),
                   "scene.xml:3: 'alpha' is too large for a float"));
    CHECK(contains(body_error("<sensor type='perspective'><film type='hdrfilm'>\n<integer name='width' "
                              "value='65536'/><integer name='height' value='65536'/></film></sensor>"),
                   "scene.xml:3: a film of 65536x65536 has more pixels than --limits pixels=268435456"));
    CHECK(contains(body_error("<integrator type='path'>\n<integer name='max_depth' value='1000000000'/></integrator>"),
                   "scene.xml:3: max_depth may be 16382 at most"));
}

TEST_CASE("loading is linear in the number of shapes") {
    const test::TempFolder folder;
    const auto seconds = [&](size_t count) {
        const std::string path = folder.write("s.xml", wrap(kSensor + repeat("<shape type='sphere'/>\n", count)));
        const auto start = std::chrono::steady_clock::now();
        CHECK(load_mitsuba(path).shapes.size() == count);
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    // Quadratic time would take 64 times as long, some 20 seconds: as much room as a busy machine needs.
    const double few = std::max(seconds(5000), 0.01);
    CHECK(seconds(40000) < 30 * few);
}
