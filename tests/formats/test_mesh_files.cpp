// libs: ambilux_formats ambilux_accel OpenEXR::OpenEXR ZLIB::ZLIB JPEG::JPEG
// timeout: 60
// Mesh and image readers against files made here byte by byte.
#include <ImfRgbaFile.h>
#include <zlib.h>

#include <cmath>
#include <cstring>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/math.h"
#include "core/sha256.h"
#include "formats/images/image_io.h"
#include "formats/meshes/mesh.h"
#include "tests/support/catch.h"
#include "tests/support/image_files.h"
#include "tests/support/temp_folder.h"

using namespace ambilux;

namespace {

/// Message of the Error that `f` throws; empty if it throws none.
template <class F>
std::string error_of(const F& f) {
    try {
        f();
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

template <class T>
void put(std::string& out, T value, bool big_endian = false) {
    char bytes[sizeof(T)];
    memcpy(bytes, &value, sizeof(T));
    if (big_endian) std::reverse(bytes, bytes + sizeof(T));
    out.append(bytes, sizeof(T));
}

std::string deflate_bytes(const std::string& raw) {
    uLongf size = compressBound(uLong(raw.size()));
    std::string out(size, '\0');
    REQUIRE(compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
                     uLong(raw.size())) == Z_OK);
    out.resize(size);
    return out;
}

}  // namespace

namespace {

/// Sums of the triangles' areas and of their areas as vectors, along z.
std::pair<double, double> areas(const Mesh& mesh) {
    double sum = 0, along_z = 0;
    for (const auto& f : mesh.faces) {
        const Vec3f n = cross(mesh.positions[f[1]] - mesh.positions[f[0]], mesh.positions[f[2]] - mesh.positions[f[0]]);
        sum += 0.5 * double(length(n)), along_z += 0.5 * double(n.z);
    }
    return {sum, along_z};
}

}  // namespace

TEST_CASE("concave polygons are covered by their triangles, from whichever corner the file begins") {
    // An arrow, a comb of three teeth, and a ring with a slit.
    const std::vector<std::vector<std::pair<int, int>>> shapes = {
        {{0, 0}, {2, 4}, {0, 3}, {-2, 4}},
        {{0, 0}, {6, 0}, {6, 4}, {5, 4}, {4, 1}, {4, 4}, {3, 4}, {2, 1}, {2, 4}, {0, 4}},
        {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}}};
    const double expected[] = {6, 21, 12};
    for (size_t i = 0; i < shapes.size(); ++i)
        for (size_t first = 0; first < shapes[i].size(); ++first) {
            CAPTURE(i, first);
            const size_t n = shapes[i].size();
            std::string obj, places, face = std::to_string(n), binary_face(1, char(n));
            for (size_t k = 0; k < n; ++k) {
                const auto [x, y] = shapes[i][k];
                const std::string at = std::to_string(x) + " " + std::to_string(y) + " 0\n";
                obj += "v " + at, places += at;
            }
            const std::string head = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(n) +
                                     "\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
                                     "property list uchar int vertex_indices\nend_header\n";
            std::string binary = head;
            binary.replace(binary.find("ascii"), 5, "binary_little_endian");
            for (const auto& [x, y] : shapes[i])
                for (const int v : {x, y, 0}) put(binary, float(v));
            obj += "f";
            for (size_t k = 0; k < n; ++k) {
                const size_t corner = (first + k) % n;
                obj += " " + std::to_string(corner + 1), face += " " + std::to_string(corner);
                put(binary_face, int32_t(corner));
            }
            for (const Mesh& mesh : {read_obj("a.obj", obj, false), read_ply("a.ply", head + places + face, false),
                                     read_ply("a.ply", binary + binary_face, false)}) {
                CHECK(mesh.notes.empty());
                CHECK(mesh.faces.size() == n - 2);
                CHECK(areas(mesh).first == Approx(expected[i]));
                CHECK(areas(mesh).second == Approx(expected[i]));
            }
        }
}

TEST_CASE("concave polygons that no triangles cover are noted, with how many they are") {
    const char* const crossed = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\nf 2 3 4 1\nf 1 2 3\n";
    const Mesh mesh = read_obj("a.obj", crossed, false);
    CHECK(mesh.faces.size() == 5);
    REQUIRE(mesh.notes.size() == 1);
    CHECK(mesh.notes[0].find("are cut into fans, which reach beyond them: 2") != std::string::npos);
}

TEST_CASE("OBJ: corners of all forms, negative indices, polygons, shared vertices") {
    const std::string text =
        "# comment\r\n"
        "o thing\r\n"
        "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 +1.0 0 0.5 0.5 0.5\r\n"
        "vt 0 0.25\nvt 1\nvn 0 0 1\n"
        "usemtl a\ns off\n"
        "f 1/1/1 2/2/1 3/1/1 4/1/1\n"
        "f -4/-2/-1 -3/-1/-1 -2/-2/-1\n";
    const Mesh mesh = read_obj("a.obj", text, true);
    // The second face repeats corners of the first one.
    REQUIRE(mesh.positions.size() == 4);
    REQUIRE(mesh.faces.size() == 3);
    CHECK(mesh.faces[0] == std::array<uint32_t, 3>{0, 1, 2});
    CHECK(mesh.faces[1] == std::array<uint32_t, 3>{0, 2, 3});
    CHECK(mesh.faces[2] == std::array<uint32_t, 3>{0, 1, 2});
    CHECK(mesh.positions[3] == Vec3f{0, 1, 0});
    CHECK(mesh.uvs[0].y == 0.75f);  // flipped
    CHECK(mesh.uvs[1].x == 1.0f);
    CHECK(mesh.uvs[1].y == 1.0f);  // a missing v is 0
    CHECK(mesh.normals[2] == Vec3f{0, 0, 1});
    CHECK(read_obj("a.obj", text, false).uvs[0].y == 0.25f);

    const Mesh plain = read_obj("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", true);
    CHECK(plain.normals.empty());
    CHECK(plain.uvs.empty());
    CHECK(plain.faces.size() == 1);

    // Normals at some faces only: the others become flat.
    const Mesh mixed = read_obj("c.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1 3 2\n", true);
    REQUIRE(mixed.faces.size() == 2);
    for (uint32_t v : mixed.faces[0]) CHECK(mixed.normals[v] == Vec3f{1, 0, 0});
    for (uint32_t v : mixed.faces[1]) CHECK(normalize(mixed.normals[v]) == Vec3f{0, 0, -1});
}

TEST_CASE("OBJ: what faces name and the file has none of is told once, and left out") {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";
    const Mesh plain = read_obj("m.obj", vertices + "f 1 2 3\nf 2 4 3\n", true);
    for (const std::string faces :
         {"f 1/1/1 2/2/2 3/3/3\nf 2/2/2 4/4/4 3/3/3\n", "f 1/0/9 2/0/9 3/0/9\nf 2/5/5 4/1/1 3\n"}) {
        const Mesh mesh = read_obj("m.obj", vertices + faces, true);
        CHECK(mesh.positions == plain.positions);
        CHECK(mesh.faces == plain.faces);
        CHECK(mesh.uvs.empty());
        CHECK(mesh.normals.empty());
        CHECK(mesh.notes ==
              std::vector<std::string>{"faces have indices of texture coordinates, which the obj file lacks",
                                       "faces have indices of normals, which the obj file lacks"});
    }
    const Mesh one = read_obj("m.obj", vertices + "vt 0.5 0.5\nf 1/1/1 2/1/2 3/1/3\n", true);
    CHECK(one.uvs.size() == 3);
    CHECK(one.notes == std::vector<std::string>{"faces have indices of normals, which the obj file lacks"});
}

TEST_CASE("OBJ: mistakes are named with their line") {
    const std::string start = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    const auto message = [&](const std::string& rest) {
        return error_of([&] { read_obj("m.obj", start + rest, true); });
    };
    CHECK(contains(message("f 1 2 4\n"), "m.obj:4: vertex index 4 is out of range"));
    CHECK(contains(message("f 1 2 0\n"), "m.obj:4: vertex index 0 is out of range"));
    CHECK(contains(message("f 1 2 -4\n"), "m.obj:4: vertex index -4 is out of range"));
    CHECK(contains(message("vt 0 0\nf 1/1 2/2 3/1\n"), "m.obj:5: texture coordinate index 2 is out of range"));
    CHECK(contains(message("vn 0 0 1\nf 1//1 2//-2 3//1\n"), "m.obj:5: normal index -2 is out of range"));
    CHECK(contains(message("f 1/1 2/1 3/1\nvt 0 0\n"), "m.obj:4: texture coordinates are named before the first"));
    CHECK(contains(message("f 1 2 3\nf 1//1 2//1 3//1\nvn 0 0 1\n"), "m.obj:5: normals are named before the first"));
    CHECK(contains(message("\nf 1 2\n"), "m.obj: the mesh has no faces"));
    CHECK(contains(message("v 1 x 2\n"), "m.obj:4: expected a number in 'v'"));
    CHECK(contains(message("v nan 0 0\nf 1 2 4\n"), "m.obj: position of vertex 2 is not finite"));
    CHECK(contains(message("f a b c\n"), "m.obj:4: expected a vertex index"));
    CHECK(contains(message(""), "m.obj: the mesh has no faces"));
}

TEST_CASE("PLY: ascii and both byte orders give the same mesh") {
    const std::string properties =
        "element vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty uchar red\nproperty float "
        "nx\nproperty float ny\n"
        "property float nz\nproperty float s\nproperty float t\nelement extra 1\nproperty list uchar short "
        "junk\nelement face 2\n"
        "property list uchar int vertex_indices\nproperty float quality\nend_header\n";
    const float xyz[4][3] = {{0, 0, 0.5f}, {1, 0, 0.5f}, {1, 1, 0.5f}, {0, 1, 0.5f}};
    std::string ascii = "ply\nformat ascii 1.0\ncomment x\nobj_info y\n" + properties;
    for (const auto& p : xyz)
        ascii += std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + " 7 0 0 1 " +
                 std::to_string(p[0]) + " 0.25\n";
    ascii += "2 -1 5\n4 0 1 2 3 0.5\n3 0 2 3 0.5\n";
    const Mesh expected = read_ply("a.ply", ascii, false);
    REQUIRE(expected.positions.size() == 4);
    REQUIRE(expected.faces.size() == 3);
    CHECK(expected.positions[2] == Vec3f{1, 1, 0.5f});
    CHECK(expected.normals[1] == Vec3f{0, 0, 1});
    CHECK(expected.uvs[1].x == 1.0f);
    CHECK(expected.faces[1] == std::array<uint32_t, 3>{0, 2, 3});
    CHECK(read_ply("a.ply", ascii, true).uvs[1].y == 0.75f);

    for (const bool big : {false, true}) {
        std::string binary =
            std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian 1.0\n" + properties;
        for (const auto& p : xyz) {
            put(binary, p[0], big), put(binary, double(p[1]), big), put(binary, p[2], big), put(binary, uint8_t(7));
            for (float v : {0.0f, 0.0f, 1.0f, p[0], 0.25f}) put(binary, v, big);
        }
        put(binary, uint8_t(2)), put(binary, int16_t(-1), big), put(binary, int16_t(5), big);
        put(binary, uint8_t(4));
        for (int32_t i : {0, 1, 2, 3}) put(binary, i, big);
        put(binary, 0.5f, big), put(binary, uint8_t(3));
        for (int32_t i : {0, 2, 3}) put(binary, i, big);
        put(binary, 0.5f, big);
        const Mesh mesh = read_ply("b.ply", binary, false);
        CHECK(mesh.positions == expected.positions);
        CHECK(mesh.normals == expected.normals);
        CHECK(mesh.faces == expected.faces);
        CHECK(mesh.uvs[3].y == expected.uvs[3].y);
        CHECK(
            contains(error_of([&] { read_ply("b.ply", std::string_view(binary).substr(0, binary.size() - 5), false); }),
                     "b.ply: file ends too early"));
    }
}

TEST_CASE("PLY: blocks of entries of a fixed size are the same as entries one by one") {
    // More entries than a block; an unknown element of a fixed size; all kinds of numbers; faces of 3 to 20 corners.
    const size_t vertices = 3000;
    const auto corners_of = [](size_t face) { return face % 7 == 3 ? 4 : (face == 1500 ? 20 : 3); };
    const std::string properties =
        "element vertex " + std::to_string(vertices) +
        "\nproperty double x\nproperty float y\nproperty short z\nproperty uchar u\n"
        "property float v\nproperty float vertex_weight_0\nproperty uchar r\nproperty uchar g\n"
        "property uchar b\nelement extra 5\nproperty int a\nproperty double b\nelement face " +
        std::to_string(vertices) +
        "\nproperty uchar mark\nproperty list ushort uint vertex_index\nproperty short end\n"
        "end_header\n";
    std::string ascii = "ply\nformat ascii 1.0\n" + properties;
    for (size_t i = 0; i < vertices; ++i)
        ascii += std::to_string(0.25 * double(i)) + " " + std::to_string(-0.5 * double(i)) + " " + std::to_string(i) +
                 " " + std::to_string(i % 2) + " 0.75 0.5 " + std::to_string(i % 256) + " 2 3\n";
    ascii += "1 2\n3 4\n5 6\n7 8\n9 10\n";
    for (size_t i = 0; i < vertices; ++i) {
        ascii += "9 ";
        ascii += std::to_string(corners_of(i));
        for (int k = 0; k < corners_of(i); ++k) {
            ascii += ' ';
            ascii += std::to_string((i + size_t(k)) % vertices);
        }
        ascii += " -1\n";
    }
    const std::set<std::string> attributes = {"vertex_weight", "vertex_color"};
    const Mesh expected = read_ply("a.ply", ascii, true, {}, attributes);
    for (const bool big : {false, true}) {
        std::string binary =
            std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian 1.0\n" + properties;
        for (size_t i = 0; i < vertices; ++i) {
            put(binary, 0.25 * double(i), big), put(binary, -0.5f * float(i), big), put(binary, int16_t(i), big);
            put(binary, uint8_t(i % 2)), put(binary, 0.75f, big), put(binary, 0.5f, big);
            put(binary, uint8_t(i % 256)), put(binary, uint8_t(2)), put(binary, uint8_t(3));
        }
        binary.append(5 * 12, 'x');
        const size_t faces_at = binary.size();
        for (size_t i = 0; i < vertices; ++i) {
            put(binary, uint8_t(9)), put(binary, uint16_t(corners_of(i)), big);
            for (int k = 0; k < corners_of(i); ++k) put(binary, uint32_t((i + size_t(k)) % vertices), big);
            put(binary, int16_t(-1), big);
        }
        const Mesh mesh = read_ply("b.ply", binary, true, {}, attributes);
        CHECK(bool(mesh.positions == expected.positions));
        CHECK(bool(mesh.faces == expected.faces));
        REQUIRE(mesh.uvs.size() == vertices);
        CHECK(mesh.uvs[2999].y == 0.25f);
        CHECK(mesh.uvs[2999].x == 1);
        REQUIRE(mesh.attributes.size() == 2);
        for (size_t a = 0; a < 2; ++a) CHECK(bool(mesh.attributes[a].values == expected.attributes[a].values));
        // Without attributes, the same.
        CHECK(bool(read_ply("b.ply", binary, true).faces == expected.faces));
        // Cut anywhere, in the vertices, the unknown element or the faces, it is refused.
        const size_t header = binary.find("end_header\n") + 11;
        for (const size_t size : {header, header + 17, faces_at - 60, faces_at - 1, faces_at + 1, faces_at + 40007,
                                  binary.size() - 3, binary.size() - 1}) {
            const std::string message =
                error_of([&] { read_ply("b.ply", std::string_view(binary).substr(0, size), false); });
            CAPTURE(size, message);
            CHECK((contains(message, "b.ply: file ends too early") || contains(message, "more than the file holds")));
        }
        // A number that is no index, in the second face, and one that is the index of no vertex.
        const size_t index_at = faces_at + 17 + 3;
        for (const auto& [value, message] :
             {std::pair{UINT32_MAX, "'4.2949673e+09' is no index"}, {5000u, "face 1 refers to vertex 5000 of 3000"}}) {
            std::string wrong = binary, bytes;
            put(bytes, value, big);
            wrong.replace(index_at, 4, bytes);
            CHECK(contains(error_of([&] { read_ply("b.ply", wrong, false); }), message));
        }
        // Too many for the limit of memory.
        Limits limits;
        limits.bytes = 50000;
        CHECK(contains(error_of([&] { read_ply("b.ply", binary, false, limits); }), "--limits bytes"));
    }
    for (const char* type : {"char", "short", "int"}) {
        std::string negative = std::string(
                                   "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                                   "property float y\nproperty float z\nelement face 1\nproperty list char ") +
                               type + " vertex_indices\nend_header\n";
        for (int i = 0; i < 9; ++i) put(negative, float(i));
        put(negative, int8_t(3));
        negative.append(12, '\xff');
        CHECK(contains(error_of([&] { read_ply("n.ply", negative, false); }), "'-1' is no index"));
        negative[negative.size() - 13] = char(-3);
        CHECK(contains(error_of([&] { read_ply("n.ply", negative, false); }), "'-3' is no index or count"));
    }
}

TEST_CASE("PLY: mistakes") {
    const auto message = [](const std::string& text) { return error_of([&] { read_ply("m.ply", text, false); }); };
    const std::string vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    const std::string faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const std::string ok = "ply\nformat ascii 1.0\n" + vertices + faces + "0 0 0\n1 0 0\n0 1 0\n";
    CHECK(message(ok + "3 0 1 2\n").empty());
    CHECK(contains(message(ok + "3 0 1 3\n"), "face 0 refers to vertex 3 of 3"));
    CHECK(contains(message(ok + "3 0 1 -1\n"), "m.ply:13: '-1' is no index or count"));
    CHECK(contains(message(ok + "2 0 1\n"), "no faces"));
    CHECK(contains(message(ok + "3 0 1"), "file ends too early"));
    CHECK(contains(message("obj\n"), "m.ply:1: not a PLY file"));
    CHECK(contains(message("ply\nformat xml 1.0\n"), "m.ply:2: unknown format 'xml'"));
    CHECK(contains(message("ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n"),
                   "m.ply:4: unknown type 'half'"));
    CHECK(contains(message("ply\nformat ascii 1.0\n" + vertices), "header has no end_header"));
    CHECK(contains(message("ply\nformat ascii 1.0\n" + vertices + "end_header\n0 0 0\n1 0 0\n0 1 0\n"), "no faces"));
    CHECK(contains(
        message(
            "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\n" +
            faces),
        "more than the file holds"));
    CHECK(contains(message("ply\nformat ascii 1.0\n" + vertices + faces + "0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n"),
                   "position of vertex 0 is not finite"));
}

TEST_CASE("serialized: versions, precision, several meshes, damage") {
    const auto stream = [](int version, bool doubles, float offset) {
        std::string raw;
        put(raw, uint32_t(0x0001 | 0x0002 | 0x0008 | (doubles ? 0x2000 : 0x1000)));
        if (version == 4) raw += std::string("name") + '\0';
        put(raw, uint64_t(3)), put(raw, uint64_t(1));
        const auto number = [&](float v) {
            if (doubles)
                put(raw, double(v));
            else
                put(raw, v);
        };
        for (float v : {offset, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) number(v);
        for (int i = 0; i < 3; ++i) number(0), number(0), number(1);  // normals
        for (float v : {0.0f, 0.25f, 1.0f, 0.25f, 0.0f, 1.0f}) number(v);
        for (int i = 0; i < 9; ++i) number(0.5f);  // colours
        for (uint32_t v : {0u, 1u, 2u}) put(raw, v);
        return deflate_bytes(raw);
    };
    for (const int version : {3, 4})
        for (const bool doubles : {false, true}) {
            std::string file;
            std::vector<uint64_t> offsets;
            for (int i = 0; i < 2; ++i) {
                offsets.push_back(file.size());
                put(file, uint16_t(0x041C)), put(file, uint16_t(version));
                file += stream(version, doubles, float(-i));
            }
            for (uint64_t o : offsets) {
                if (version == 4)
                    put(file, o);
                else
                    put(file, uint32_t(o));
            }
            put(file, uint32_t(2));
            for (int i = 0; i < 2; ++i) {
                const Mesh mesh = read_serialized("a.serialized", file, i, false);
                REQUIRE(mesh.positions.size() == 3);
                CHECK(mesh.positions[0].x == float(-i));
                CHECK(mesh.notes.size() == 1);  // it has colours
                CHECK(mesh.normals[2] == Vec3f{0, 0, 1});
                CHECK(mesh.uvs[1].y == 0.25f);
                CHECK(mesh.faces[0] == std::array<uint32_t, 3>{0, 1, 2});
            }
            CHECK(read_serialized("a.serialized", file, 0, true).uvs[1].y == 0.75f);
            const auto message = [&](const std::string& bytes, int index) {
                return error_of([&] { read_serialized("a.serialized", bytes, index, false); });
            };
            CHECK(contains(message(file, 2), "shape_index 2 is out of range"));
            CHECK(contains(message(file, -1), "shape_index -1 is out of range"));
            CHECK(contains(message("xxxxxxxxxxxx", 0), "not a Mitsuba serialized mesh"));
            std::string damaged = file;
            for (size_t i = 12; i < 40; ++i) damaged[i] = char(0x55);
            CHECK(contains(message(damaged, 0), "a.serialized: mesh"));
            // Stream cut short: the table at the end stays.
            CHECK(contains(message(file.substr(0, 30) + file.substr(file.size() - 4), 0), "a.serialized: mesh data"));
        }
}

TEST_CASE("rectangle and cube: outward faces, unit uv squares, right area") {
    for (const Mesh& mesh : {make_rectangle(), make_cube()}) {
        const bool cube = mesh.faces.size() == 12;
        REQUIRE((cube || mesh.faces.size() == 2));
        float area = 0;
        for (const auto& f : mesh.faces) {
            const Vec3f a = mesh.positions[f[0]], b = mesh.positions[f[1]], c = mesh.positions[f[2]];
            const Vec3f n = cross(b - a, c - a);
            area += 0.5f * length(n);
            if (cube)
                CHECK(dot(n, a + b + c) > 0);
            else
                CHECK(normalize(n) == Vec3f{0, 0, 1});
            const Vec2f d1 = mesh.uvs[f[1]] - mesh.uvs[f[0]], d2 = mesh.uvs[f[2]] - mesh.uvs[f[0]];
            CHECK(std::fabs(d1.x * d2.y - d1.y * d2.x) == 1.0f);
        }
        CHECK(area == (cube ? 24.0f : 4.0f));
    }
}

TEST_CASE("smooth normals weigh by angle: a cube's corner looks along the diagonal however its faces are cut") {
    Mesh mesh;
    for (int i = 0; i < 8; ++i)
        mesh.positions.push_back({i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f});
    const uint32_t quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (const auto& q : quads) mesh.faces.push_back({q[0], q[1], q[2]}), mesh.faces.push_back({q[0], q[2], q[3]});
    const std::vector<Vec3f> normals = smooth_normals(mesh);
    for (int i = 0; i < 8; ++i) CHECK(length(normals[i] - normalize(mesh.positions[i])) < 1e-6f);
}

TEST_CASE("images: 8-bit formats keep bytes, top row first") {
    const int w = 3, h = 2;
    std::vector<uint8_t> rgb(w * h * 3);
    for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = uint8_t(i * 13 + 5);
    std::string tga = test::tga_header(2, w, h, 24, 0x20), bmp("BM"), ppm = "P6\n# comment\n3 2 255\n";
    for (int i = 0; i < w * h; ++i)
        for (int c = 0; c < 3; ++c) tga += char(rgb[i * 3 + 2 - c]), ppm += char(rgb[i * 3 + c]);
    put(bmp, uint32_t(0)), put(bmp, uint32_t(0)), put(bmp, uint32_t(54));
    put(bmp, uint32_t(40)), put(bmp, int32_t(w)), put(bmp, int32_t(h)), put(bmp, uint16_t(1)), put(bmp, uint16_t(24));
    bmp.append(24, '\0');
    for (int y = h - 1; y >= 0; --y) {
        for (int i = y * w; i < (y + 1) * w; ++i)
            for (int c = 2; c >= 0; --c) bmp += char(rgb[i * 3 + c]);
        bmp.append(3, '\0');
    }
    for (const std::string& file : {png_bytes(w, h, rgb), tga, bmp, ppm}) {
        const Texels image = read_image("a", file);
        REQUIRE(image.width == 3);
        REQUIRE(image.height == 2);
        REQUIRE(image.is_8bit);
        CHECK_FALSE(image.is_linear);
        for (int i = 0; i < w * h; ++i) {
            for (int c = 0; c < 3; ++c) CHECK(int(image.bytes[i * 4 + c]) == int(rgb[i * 3 + c]));
            CHECK(int(image.bytes[i * 4 + 3]) == 255);
        }
    }
    // A flat colour survives JPEG within its quantisation.
    std::vector<uint8_t> flat(16 * 16 * 3, 100);
    const Texels image = read_image("a.jpg", test::jpeg_file(16, 16, flat));
    REQUIRE(image.width == 16);
    for (uint8_t b : {image.bytes[0], image.bytes[1], image.bytes[2], image.bytes[40]})
        CHECK(std::abs(int(b) - 100) <= 2);
    CHECK(contains(error_of([] { read_image("bad.png", "this is no image"); }), "bad.png: cannot read image"));
}

TEST_CASE("images: 16-bit PNG becomes floats") {
    const auto chunk = [](const std::string& type, const std::string& data) {
        std::string out;
        put(out, uint32_t(data.size()), true);
        const std::string body = type + data;
        out += body;
        put(out, uint32_t(crc32(0, reinterpret_cast<const Bytef*>(body.data()), uInt(body.size()))), true);
        return out;
    };
    std::string header;
    put(header, uint32_t(2), true), put(header, uint32_t(1), true);
    header += std::string("\x10\x02\x00\x00\x00", 5);  // 16 bits, RGB
    std::string row(1, '\0');
    for (uint16_t v : {0, 257, 65535, 32768, 1, 2}) put(row, v, true);
    const std::string png = std::string("\x89PNG\r\n\x1a\n", 8) + chunk("IHDR", header) +
                            chunk("IDAT", deflate_bytes(row)) + chunk("IEND", "");
    const Texels image = read_image("a.png", png);
    REQUIRE_FALSE(image.is_8bit);
    CHECK_FALSE(image.is_linear);
    REQUIRE(image.floats.size() == 8);
    CHECK(image.floats[1] == 257.0f / 65535.0f);
    CHECK(image.floats[2] == 1.0f);
    CHECK(image.floats[4] == 32768.0f / 65535.0f);
}

TEST_CASE("images: HDR and EXR are linear floats") {
    const float pixels[2 * 3] = {0.5f, 2.0f, 8.0f, 0.25f, 0.25f, 0.25f};
    const std::string hdr = test::hdr_header(2, 1) + test::rgbe(pixels[0], pixels[1], pixels[2]) +
                            test::rgbe(pixels[3], pixels[4], pixels[5]);
    const Texels image = read_image("a.hdr", hdr);
    REQUIRE(image.is_linear);
    REQUIRE(image.floats.size() == 8);
    for (int i = 0; i < 2; ++i)
        for (int c = 0; c < 3; ++c) CHECK(image.floats[i * 4 + c] == Approx(pixels[i * 3 + c]).margin(8.0 / 128));

    const test::TempFolder folder;
    const std::string path = (folder.path / "a.exr").string();
    {
        // A data window away from the origin, top row first.
        std::vector<Imf::Rgba> data(54);  // pixel (x,y) at x + 2y
        for (int i = 0; i < 4; ++i) data[size_t(50 + i)] = Imf::Rgba(float(i), 0.5f, 0.25f, 1.0f);
        const Imath::Box2i window({10, 20}, {11, 21});
        Imf::RgbaOutputFile file(path.c_str(), window, window, Imf::WRITE_RGB);
        file.setFrameBuffer(data.data(), 1, 2);
        file.writePixels(2);
    }
    const std::string bytes = read_file(path);
    const Texels exr = read_image(path, bytes);
    REQUIRE(exr.width == 2);
    REQUIRE(exr.height == 2);
    REQUIRE(exr.is_linear);
    for (int i = 0; i < 4; ++i) {
        CHECK(exr.floats[i * 4] == float(i));
        CHECK(exr.floats[i * 4 + 1] == 0.5f);
        CHECK(exr.floats[i * 4 + 3] == 1.0f);
    }
    CHECK(contains(error_of([&] { read_image("cut.exr", std::string_view(bytes).substr(0, bytes.size() / 2)); }),
                   "cut.exr: the file ends too early"));
}

TEST_CASE("SHA-256: vectors of FIPS 180-4's examples, and any way to cut the input") {
    CHECK(to_hex(sha256("abc")) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    CHECK(to_hex(sha256("")) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    CHECK(to_hex(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq")) ==
          "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    CHECK(to_hex(sha256(std::string(1000000, 'a'))) ==
          "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    const std::string text(300, 'q');
    for (size_t cut = 0; cut <= 200; ++cut) {
        Sha256 hash;
        hash.update(text.substr(0, cut));
        hash.update(text.substr(cut));
        REQUIRE(hash.digest() == sha256(text));
    }
}
