// libs: ambilux_formats ambilux_accel
// timeout: 60
// What programs call things in mesh files, and how they write them.
#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "formats/meshes/mesh.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

const std::string kVertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

bool same(const Mesh& a, const Mesh& b) {
    const auto bytes = [](const auto& v) {
        return std::string_view(reinterpret_cast<const char*>(v.data()), v.size() * sizeof v[0]);
    };
    return bytes(a.positions) == bytes(b.positions) && bytes(a.normals) == bytes(b.normals) &&
           bytes(a.uvs) == bytes(b.uvs) && a.faces == b.faces;
}

/// A square of two triangles, in text; `more`: declarations of properties of vertices, `values`: of each of the four.
std::string square(const std::string& more, const std::array<std::string, 4>& values) {
    constexpr const char* kCorners[] = {"-1 -1 0 ", "1 -1 0 ", "1 1 0 ", "-1 1 0 "};
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n" + more +
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    for (size_t i = 0; i < 4; ++i) text += kCorners[i] + values[i] + "\n";
    return text + "3 0 1 2\n3 0 2 3\n";
}

std::string properties(const std::string& type, std::initializer_list<const char*> names) {
    std::string text;
    for (const char* name : names) text += "property " + type + " " + name + "\n";
    return text;
}

bool is_at(Vec2f uv, float x, float y) { return uv.x == x && uv.y == y; }

template <class T>
void put(std::string& out, T value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

TEST_CASE("OBJ: slashes without an index, comments and continued lines anywhere change nothing") {
    const auto read = [](const std::string& faces) { return read_obj("a.obj", kVertices + faces, true); };
    const Mesh plain = read("f 1 2 3 4\n"), with_uvs = read("f 1/1 2/2 3/3 4/4\n");
    for (const char* faces : {"f 1/ 2/ 3/ 4/\n", "f 1// 2// 3// 4//\n", "f 1 2/ 3// 4\n", "f 1 2 3 4 # 5 6\n",
                              "f 1 2 3 4# 5\n", "f 1 2 \\\n 3 4\n", "f 1 2\\\n3 4", "f \\\n1 \\  \n2 \\\n3 \\\n4\n",
                              "  f 1 2 3 4  \t\n", "fo 1 2 3 4\n", "# f 1 2 3 \\\nf 1 2 3 4\n", "# C:\\\nf 1 2 3 4"}) {
        CAPTURE(faces);
        CHECK(same(read(faces), plain));
        CHECK(read(faces).notes.empty());
    }
    CHECK(same(read("f 1/1/ 2/2/ 3/3/ 4/4/\n"), with_uvs));
    // Numbers too may stand in lines that go on.
    CHECK(same(read_obj("a.obj", "v 0 \\\n0 0 # origin\nv 1 0 0#x\nv 1 1 0\nf 1 2 \\\n3", true),
               read_obj("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", true)));
}

TEST_CASE("OBJ: faces of two corners are left out, and what is not used is named, each in one note") {
    const Mesh mesh = read_obj("a.obj", kVertices + "f 1 2\nf 1/1 2/2 3/3\nf 3\nl 1 2\nl 2 3\np 1\ns off\ng a\n", true);
    CHECK(mesh.faces.size() == 1);
    REQUIRE(mesh.notes.size() == 2);
    CHECK(contains(mesh.notes[0], "fewer than three corners are left out: 2"));
    CHECK(contains(mesh.notes[1], "unused data: 'l', 'p'"));
    const Mesh colored = read_obj("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 5 5 5 1\nf 1 2 3\n", true);
    REQUIRE(colored.notes.size() == 1);
    CHECK(contains(colored.notes[0], "colours of vertices"));
}

TEST_CASE("OBJ: colours behind the places of vertices are the attribute vertex_color, as those of PLY files are") {
    const std::string vertices = "v 0 0 0 1 0.5 0\nv 1 0 0 0 0.25 1\nv 1 1 0 0.5 0.5 0.5\n",
                      faces = "vn 0 0 1\nf 1//1 2//1 3//1\nf 3 2 1\n";
    const auto read = [](const std::string& text) { return read_obj("a.obj", text, true, {}, {"vertex_color"}); };
    const Mesh mesh = read(vertices + faces);
    CHECK(mesh.notes.empty());
    REQUIRE(mesh.attributes.size() == 1);
    CHECK(mesh.attributes[0].name == "vertex_color");
    // Every vertex has one, also those that a face without normals got for itself.
    REQUIRE(mesh.attributes[0].values.size() == mesh.positions.size());
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
        const Vec3f p = mesh.positions[i];
        check_rgb(mesh.attributes[0].values[i], p.x == 0   ? Rgb{1, 0.5f, 0}
                                                : p.y == 0 ? Rgb{0, 0.25f, 1}
                                                           : Rgb{0.5f, 0.5f, 0.5f});
    }
    // A weight is no colour, and what comes behind a colour is left out.
    CHECK(read("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").attributes.empty());
    CHECK(read("v 0 0 0 1 0 0 9\nv 1 0 0 1 0 0 x\nv 0 1 0 1 0 0\nf 1 2 3\n").attributes[0].values[1] == Rgb{1, 0, 0});
    const auto message = [&](const std::string& text) -> std::string {
        try {
            read(text);
        } catch (const Error& e) {
            return e.what();
        }
        return "no error";
    };
    CHECK(contains(message("v 0 0 0\n" + vertices + "f 1 2 3\n"), "colours are given for 3 of 4 vertices"));
    CHECK(contains(message("v 0 0 0 1 red 0\n"), "a.obj:1: expected a number in 'v'"));
    // In a scene; where nothing shows them they are told once.
    const TempFolder folder;
    folder.write("m.obj", vertices + faces);
    const auto scene = [&](const std::string& texture) {
        return load("<shape type='obj'><string name='filename' value='m.obj'/><bsdf type='diffuse'>" + texture +
                        "</bsdf></shape><emitter type='point'/>",
                    {}, "3.0.0", &folder);
    };
    const Scene shown =
        scene("<texture name='reflectance' type='mesh_attribute'><string name='name' value='vertex_color'/></texture>");
    float texel[3];
    memcpy(texel, shown.texels.data() + shown.textures.at(0).offset, sizeof texel);
    check_rgb({texel[0], texel[1], texel[2]}, {1, 0.5f, 0}, 1e-6);
    CHECK_FALSE(has_note(shown, "unused data"));
    CHECK(has_note(scene(""), "the obj file has unused data: colours of vertices"));
}

TEST_CASE("PLY: texture coordinates of corners divide the vertices where they differ") {
    const auto file = [](const std::string& more, const std::string& first, const std::string& second) {
        return "ply\nformat ascii 1.0\nelement vertex 4\n" + properties("float", {"x", "y", "z", "nx", "ny", "nz"}) +
               "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n" + more +
               "end_header\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 2\n" + first + "\n" + second + "\n";
    };
    // A seam through vertices 0 and 2; corner 0 of the second face has what it had in the first one.
    const std::string seam = file("", "3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0 0 0.5 0.5 0 1");
    const Mesh mesh = read_ply("a.ply", seam, false);
    CHECK(mesh.notes.empty());
    REQUIRE(mesh.positions.size() == 5);
    REQUIRE(mesh.faces.size() == 2);
    CHECK(mesh.faces[0] == std::array<uint32_t, 3>{0, 1, 2});
    CHECK(mesh.faces[1] == std::array<uint32_t, 3>{0, 4, 3});
    CHECK(mesh.positions[4] == mesh.positions[2]);
    CHECK(mesh.normals.size() == 5);
    CHECK(mesh.normals[3] == Vec3f{0, 0, 2});
    CHECK((is_at(mesh.uvs[2], 1, 1) && is_at(mesh.uvs[4], 0.5f, 0.5f) && is_at(mesh.uvs[3], 0, 1)));
    CHECK(is_at(read_ply("a.ply", seam, true).uvs[2], 1, 0));
    CHECK(ply_has_uvs("a.ply", seam));
    // The same as an OBJ file says it, but for the order of the vertices.
    const Mesh obj = read_obj("a.obj",
                              "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt .5 .5\nvt 0 1\n"
                              "f 1/1 2/2 3/3\nf 1/1 3/4 4/5\n",
                              false);
    REQUIRE(obj.positions.size() == 5);
    for (size_t f = 0; f < 2; ++f)
        for (size_t k = 0; k < 3; ++k) {
            CHECK(obj.positions[obj.faces[f][k]] == mesh.positions[mesh.faces[f][k]]);
            const Vec2f uv = mesh.uvs[mesh.faces[f][k]];
            CHECK(is_at(obj.uvs[obj.faces[f][k]], uv.x, uv.y));
        }
    // A polygon is a fan; a face may have none; the number of the image is named, since there is one for all.
    const Mesh fan =
        read_ply("a.ply", file("property int texnumber\n", "4 0 1 2 3 8 0 0 1 0 1 1 0 1 0", "3 0 1 3 0 1"), false);
    REQUIRE(fan.faces.size() == 3);
    CHECK(is_at(fan.uvs[fan.faces[1][2]], 0, 1));
    CHECK(is_at(fan.uvs[fan.faces[2][2]], 0, 0));
    REQUIRE(fan.notes.size() == 1);
    CHECK(contains(fan.notes[0], "unused data: texnumber of element face"));
    const auto message = [&](const std::string& first) -> std::string {
        try {
            read_ply("a.ply", file("", first, "3 0 1 2 6 0 0 1 0 1 1"), false);
        } catch (const Error& e) {
            return e.what();
        }
        return "no error";
    };
    CHECK(contains(message("3 0 1 2 4 0 0 1 0"), "a face of 3 corners has texture coordinates of 2"));
    CHECK(contains(message("3 0 1 2 5 0 0 1 0 1"), "'texcoord' needs two numbers for each corner"));
    CHECK(contains(message("3 0 1 9 6 0 0 1 0 1 1"), "face 0 refers to vertex 9 of 4"));
    CHECK(contains(message("3 0 1 2 6 0 0 nan 0 1 1"), "texture coordinate of vertex"));
}

TEST_CASE("PLY: texture coordinates of corners in binary files, with colours, and beside those of vertices") {
    std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n" +
                       properties("float", {"x", "y", "z", "s", "t"}) + properties("uchar", {"red", "green", "blue"}) +
                       "element face 2\nproperty list uchar int vertex_indices\n"
                       "property list uchar float texcoord\nend_header\n";
    for (int v = 0; v < 3; ++v) {
        for (const float f : {float(v == 1), float(v == 2), 0.0f, 9.0f, 9.0f}) put(text, f);
        for (int c = 0; c < 3; ++c) put(text, uint8_t(51 * v));
    }
    for (int f = 0; f < 2; ++f) {
        put(text, uint8_t(3));
        for (int k = 0; k < 3; ++k) put(text, k);
        put(text, uint8_t(6));
        for (int k = 0; k < 6; ++k) put(text, 0.125f * float(k + f));
    }
    const Mesh mesh = read_ply("a.ply", text, false, {}, {"vertex_color"});
    REQUIRE(mesh.positions.size() == 6);
    REQUIRE(mesh.attributes.size() == 1);
    REQUIRE(mesh.attributes[0].values.size() == 6);
    CHECK(is_at(mesh.uvs[mesh.faces[1][1]], 0.375f, 0.5f));
    CHECK(mesh.attributes[0].values[mesh.faces[1][2]].x == Approx(2 * 51 / 255.0));
    REQUIRE(mesh.notes.size() == 1);
    CHECK(contains(mesh.notes[0], "texture coordinates of corners count, and not those of vertices"));
}

TEST_CASE("PLY: coordinates and normals by all their names give the same mesh, without a note") {
    const std::array<std::string, 4> uvs = {"0 0", "1 0", "1 1", "0 1"}, normals = {"0 0 1", "0 1 0", "1 0 0", "0 0 1"};
    const auto read = [](const std::string& more, const std::array<std::string, 4>& values) {
        return read_ply("a.ply", square(more, values), false);
    };
    const Mesh plain = read(properties("float", {"u", "v"}), uvs);
    REQUIRE(plain.uvs.size() == 4);
    for (const auto& names :
         {std::initializer_list<const char*>{"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}) {
        const std::string text = square(properties("double", names), uvs);
        CHECK(same(read_ply("a.ply", text, false), plain));
        CHECK(read_ply("a.ply", text, false).notes.empty());
        CHECK(ply_has_uvs("a.ply", text));
    }
    CHECK_FALSE(ply_has_uvs("a.ply", square(properties("float", {"u", "t"}), uvs)));
    CHECK(same(read(properties("float", {"normal_x", "normal_y", "normal_z"}), normals),
               read(properties("float", {"nx", "ny", "nz"}), normals)));
    // Of two pairs the first counts, and the other is named.
    const Mesh both = read(properties("float", {"s", "t", "u", "v"}), {"7 7 0 0", "7 7 1 0", "7 7 1 1", "7 7 0 1"});
    CHECK(same(both, plain));
    REQUIRE(both.notes.size() == 1);
    CHECK(contains(both.notes[0], "unused data: s t of element vertex"));
}

TEST_CASE("PLY: colours by all their names are attributes; bytes are 255ths, words 65535ths") {
    const std::set<std::string> wanted = {"vertex_color", "face_color"};
    const auto color = [&](const std::string& type, std::initializer_list<const char*> names, const char* value) {
        const Mesh mesh =
            read_ply("a.ply", square(properties(type, names), {value, value, value, value}), false, {}, wanted);
        REQUIRE(mesh.attributes.size() == 1);
        CHECK(mesh.attributes[0].name == "vertex_color");
        return mesh.attributes[0].values.at(3);
    };
    for (const auto& names : {std::initializer_list<const char*>{"red", "green", "blue"},
                              {"r", "g", "b"},
                              {"diffuse_red", "diffuse_green", "diffuse_blue"}}) {
        check_rgb(color("float", names, "0.8 0.4 0.2"), {0.8f, 0.4f, 0.2f}, 1e-6);
        check_rgb(color("uchar", names, "200 100 50"), Rgb{200, 100, 50} / 255.0f, 1e-6);
        check_rgb(color("ushort", names, "65535 0 13107"), {1, 0, 0.2f}, 1e-6);
    }
    const std::string text =
        square(properties("uchar", {"red", "green", "blue", "alpha"}), {"1 2 3 4", "1 2 3 4", "1 2 3 4", "1 2 3 4"});
    const Mesh kept = read_ply("a.ply", text, false, {}, wanted), left = read_ply("a.ply", text, false);
    REQUIRE(kept.notes.size() == 1);
    CHECK(contains(kept.notes[0], "unused data: alpha of element vertex"));
    CHECK(left.attributes.empty());
    REQUIRE(left.notes.size() == 1);
    CHECK(contains(left.notes[0], "unused data: red green blue alpha of element vertex"));
}

TEST_CASE("PLY: bytes of colours are sRGB in formats 0.x and linear, with a note, in format 3") {
    const TempFolder folder;
    folder.write("m.ply", square(properties("uchar", {"red", "green", "blue"}),
                                 {"200 100 50", "200 100 50", "200 100 50", "200 100 50"}));
    const auto scene = [&](const std::string& version, const std::string& texture) {
        return load("<shape type='ply'><string name='filename' value='m.ply'/><bsdf type='diffuse'>" + texture +
                        "</bsdf></shape><emitter type='point'/>",
                    {}, version, &folder);
    };
    const std::string attribute =
        "<texture name='reflectance' type='mesh_attribute'><string name='name' value='vertex_color'/></texture>";
    const Scene older = scene("0.6.0", "<texture name='reflectance' type='vertexcolors'/>");
    const Scene newer = scene("3.0.0", attribute);
    const auto first = [](const Scene& s) {
        float texel[3];
        memcpy(texel, s.texels.data() + s.textures.at(0).offset, sizeof texel);
        return Rgb{texel[0], texel[1], texel[2]};
    };
    check_rgb(first(older), {0.5776f, 0.1274f, 0.0319f}, 1e-4);
    check_rgb(first(newer), Rgb{200, 100, 50} / 255.0f, 1e-5);
    CHECK_FALSE(has_note(older, "255"));
    CHECK(has_note(newer, "integer colours are divided by 255"));
    // Nothing shows them here: they are named once, for both shapes.
    CHECK(has_note(scene("3.0.0", ""), "m.ply: the ply file has unused data: red green blue"));
    CHECK_FALSE(has_note(newer, "unused data"));
}

TEST_CASE("normals that are not finite count as none, with their number in a note, in every mesh file") {
    const std::string names = properties("float", {"nx", "ny", "nz"});
    for (const char* bad : {"nan 0 1", "0 -inf 1", "nan nan nan", "1.#QNAN -1.#IND00 0", "-nan(ind) 0 0"}) {
        CAPTURE(bad);
        const Mesh ply = read_ply("a.ply", square(names, {"0 0 1", bad, "0 0 1", bad}), false);
        CHECK(ply.normals[0] == Vec3f{0, 0, 1});
        CHECK(ply.normals[1] == Vec3f{0, 0, 0});
        REQUIRE(ply.notes.size() == 1);
        CHECK(contains(ply.notes[0], "not finite are replaced by the triangle's: 2"));
        const Mesh obj = read_obj("a.obj", kVertices + "vn " + bad + "\nf 1//1 2//2 3//1\n", true);
        CHECK(obj.normals[1] == Vec3f{0, 0, 0});
        CHECK(obj.notes.size() == 1);
    }
    // The scene has the normal of the triangle there.
    const TempFolder folder;
    folder.write("m.ply", square(names, {"0 0 1", "nan 0 1", "0 0 1", "0 0 1"}));
    const Scene s = load("<shape type='ply'><string name='filename' value='m.ply'/></shape><emitter type='point'/>", {},
                         "3.0.0", &folder);
    for (const MeshVertex& v : s.vertices) CHECK(v.n == Vec3f{0, 0, 1});
    CHECK(has_note(s, "m.ply: normals that are not finite are replaced by the triangle's: 1"));
    const Scene p =
        load_pbrt_world("LightSource \"point\"\nShape \"plymesh\" \"string filename\" \"m.ply\"", {}, &folder);
    for (const MeshVertex& v : p.vertices) CHECK(v.n == Vec3f{0, 0, 1});
    CHECK(has_note(p, "m.ply: normals that are not finite are replaced by the triangle's: 1"));
}

TEST_CASE("PLY: triangle strips turn over at every second triangle and end at -1") {
    const std::string head =
        "element vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    std::string ascii = "ply\nformat ascii 1.0\n" + head, binary = "ply\nformat binary_little_endian 1.0\n" + head;
    for (int i = 0; i < 6; ++i) {
        ascii += std::to_string(i / 2) + " " + std::to_string(i % 2) + " 0\n";
        put(binary, float(i / 2)), put(binary, float(i % 2)), put(binary, 0.0f);
    }
    const int strip[] = {0, 1, 2, 3, 4, -1, 2, 2, 3, 4, -1, 5, 4};
    ascii += "13";
    put(binary, 13);
    for (int i : strip) ascii += " " + std::to_string(i), put(binary, i);
    const std::vector<std::array<uint32_t, 3>> expected = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {3, 2, 4}};
    for (const std::string& file : {ascii, binary}) {
        const Mesh mesh = read_ply("a.ply", file, false);
        CHECK(mesh.faces == expected);
        CHECK(mesh.notes.empty());
    }
    ascii.replace(ascii.size() - 1, 1, "6");
    CHECK(read_ply("a.ply", ascii, false).faces == expected);  // a strip of two corners has no triangle
}

TEST_CASE("coordinates in doubles far from 0 lose nothing where a transform takes the large part away") {
    constexpr double kFar[3] = {4500000.25, -512345.5, 100000};
    const auto at = [&](int i, int k, bool moved) {
        const double local[4][3] = {{-1, -1, 0.125}, {1, -1, 0.1}, {1, 1, 0.3}, {-1, 1, 0.7}};
        return local[i][k] + (moved ? kFar[k] : 0);
    };
    const auto files = [&](bool moved) {
        const std::string head = "element vertex 4\n" + properties("double", {"x", "y", "z"}) +
                                 "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        std::string obj, ascii = "ply\nformat ascii 1.0\n" + head,
                         binary = "ply\nformat binary_little_endian 1.0\n" + head;
        for (int i = 0; i < 4; ++i) {
            std::string line;
            for (int k = 0; k < 3; ++k) line += fmt::format(" {:.12f}", at(i, k, moved)), put(binary, at(i, k, moved));
            obj += "v" + line + "\n", ascii += line + "\n";
        }
        put(binary, uint8_t(4));
        for (int i : {0, 1, 2, 3}) put(binary, i);
        return std::array<std::string, 3>{obj + "f 1 2 3 4\n", ascii + "4 0 1 2 3\n", binary};
    };
    const TempFolder folder;
    const auto scene = [&](const std::string& type, const std::string& bytes, bool moved) {
        folder.write("m", bytes);
        return load("<shape type='" + type + "'><string name='filename' value='m'/><transform name='to_world'>" +
                        (moved ? fmt::format("<translate x='{}' y='{}' z='{}'/>", -kFar[0], -kFar[1], -kFar[2]) : "") +
                        "<rotate x='1' y='2' angle='30'/></transform></shape><emitter type='point'/>",
                    {}, "3.0.0", &folder);
    };
    for (int i = 0; i < 3; ++i) {
        CAPTURE(i);
        const std::string type = i ? "ply" : "obj";
        const Scene near = scene(type, files(false)[size_t(i)], false), far = scene(type, files(true)[size_t(i)], true);
        REQUIRE(near.vertices.size() == far.vertices.size());
        for (size_t v = 0; v < near.vertices.size(); ++v) CHECK(length(near.vertices[v].p - far.vertices[v].p) < 1e-6f);
    }
}
