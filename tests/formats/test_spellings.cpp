// libs: ambilux_formats ambilux_accel
// timeout: 120
// One scene in many spellings: line ends, marks, encodings, comments, order of attributes and numbers mean nothing.
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <random>

#include "core/text.h"
#include "formats/images/image_io.h"
#include "formats/meshes/curves.h"
#include "formats/meshes/mesh.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr int kSpellings = 120;  ///< of each format
const std::string kMark = "\xEF\xBB\xBF";

struct Writer {
    std::mt19937 random;
    bool plain = false;  ///< the one spelling that the others are compared with

    size_t pick(size_t count) { return plain ? 0 : random() % count; }
    std::string one_of(std::initializer_list<const char*> all) { return all.begin()[pick(all.size())]; }

    std::string number(double v) {
        std::string text = fmt::format("{}", v);
        switch (pick(6)) {
            case 1: text = fmt::format("{:e}", v); break;
            case 2: text = fmt::format("{:.12f}", v); break;
            case 3: text = fmt::format("{:E}", v); break;
            case 4:
                if (text.starts_with("0.")) text.erase(0, 1);
                break;
            case 5: text = fmt::format("{}{}", v, text.find_first_of(".e") == std::string::npos ? "." : ""); break;
            default: break;
        }
        return v >= 0 && pick(5) == 1 ? "+" + text : text;
    }
    std::string numbers(std::initializer_list<double> all, const std::string& between) {
        std::string text;
        for (double v : all) text += (text.empty() ? "" : between) + number(v);
        return text;
    }
    /// In another encoding of the format, with its own line ends.
    std::string file(const std::string& text, bool may_be_utf16 = false) {
        const std::string ends = one_of({"\n", "\r\n", "\r"});
        std::string out;
        for (char c : text) out += c == '\n' ? ends : std::string(1, c);
        const size_t encoding = pick(may_be_utf16 ? 4 : 2);
        if (encoding == 1) return kMark + out;
        if (encoding < 2) return out;
        const bool big = encoding == 3;
        std::string wide;
        const auto put = [&](uint8_t high, uint8_t low) { (wide += char(big ? high : low)) += char(big ? low : high); };
        if (pick(2)) put(0xFE, 0xFF);
        for (char c : out) put(0, uint8_t(c));
        return wide;
    }
};

template <class Array>
std::string_view bytes_of(const Array& v) {
    return {reinterpret_cast<const char*>(v.data()), v.size() * sizeof(*v.data())};
}

void check_same(const Scene& a, const Scene& b) {
    CHECK(bytes_of(a.vertices) == bytes_of(b.vertices));
    CHECK(bytes_of(a.triangles) == bytes_of(b.triangles));
    CHECK(bytes_of(a.quadrics) == bytes_of(b.quadrics));
    CHECK(bytes_of(a.bsdfs) == bytes_of(b.bsdfs));
    CHECK(bytes_of(a.emitters) == bytes_of(b.emitters));
    CHECK(bytes_of(a.tables) == bytes_of(b.tables));
    CHECK(memcmp(&a.sensor, &b.sensor, sizeof a.sensor) == 0);
    CHECK(a.notes.size() == b.notes.size());
}

/// Loads what `write` makes in its plain spelling and in many others.
void check_spellings(const std::function<Scene(Writer&)>& load_written) {
    Writer plain{std::mt19937(1), true};
    const Scene expected = load_written(plain);
    REQUIRE(expected.vertices.size() > 2);
    for (int i = 0; i < kSpellings; ++i) {
        CAPTURE(i);
        Writer writer{std::mt19937(uint32_t(i))};
        check_same(load_written(writer), expected);
    }
}

std::string obj_text(Writer& w) {
    const auto end = [&] {
        return w.one_of({"\n", " \n", "\t\n", " # it's a comment\n", "#\n", "\n\n", "\n# f 1 2 3 \\\n"});
    };
    const auto gap = [&] { return w.one_of({" ", "  ", "\t", " \\\n", "\\\n ", " \\ \n\t"}); };
    std::string text = w.one_of({"", "# head\n", "\n", "mtllib none.mtl\n"});
    for (const auto& p : {std::array{0.0, 0.0, 0.5}, {1.0, 0.0, 0.25}, {1.0, 1.0, 0.125}, {-0.5, 1.0, 1e-3}})
        text += w.one_of({"", " ", "\t"}) + "v" + gap() + w.numbers({p[0], p[1], p[2]}, gap()) + end();
    const std::string slashes = w.one_of({"", "/", "//"});
    text += "f";
    for (const char* v : {"1", "2", "3", "4"}) text += gap() + v + slashes;
    return text + w.one_of({"\n", "", " ", " # end"});
}

std::string ply_text(Writer& w) {
    const auto end = [&] { return w.one_of({"\n", " \n", "\n\n", "\ncomment x y z\n", "\nobj_info f\n"}); };
    const std::string real = w.one_of({"float", "float32", "double", "float64"});
    std::string text = "ply\nformat ascii 1.0" + end() + "element vertex 3" + end();
    for (const char* name : {"x", "y", "z"}) text += "property " + real + w.one_of({" ", "  ", "\t"}) + name + end();
    text += "element face 1" + end() + "property list uchar " + w.one_of({"int", "uint", "int32", "ushort"}) + " " +
            w.one_of({"vertex_indices", "vertex_index"}) + end() + "end_header\n";
    const auto gap = [&] { return w.one_of({" ", "  ", "\t", "\n"}); };
    for (const auto& p : {std::array{0.0, 0.0, 0.5}, {1.0, 0.0, 0.25}, {1.0, 1.0, 0.125}})
        text += w.numbers({p[0], p[1], p[2]}, gap()) + w.one_of({"\n", " \n", " "});
    return text + "3 0 1 2" + w.one_of({"\n", "", "\n\n"});
}

std::string xml_element(Writer& w, const std::string& tag, std::vector<std::array<std::string, 2>> attributes,
                        const std::string& inside = "") {
    std::string text = "<" + tag;
    if (!w.plain) std::shuffle(attributes.begin(), attributes.end(), w.random);
    for (const auto& [name, value] : attributes) {
        const std::string quote = w.one_of({"'", "\""});
        text += w.one_of({" ", "\n", "\t ", "  "}) + name + w.one_of({"=", " = "}) + quote + value + quote;
    }
    const std::string behind = w.one_of({"", "\n", "<!-- <a> & -->", "\n<!--\n-->\n", "<?note x?>"});
    if (inside.empty() && w.pick(2)) return text + w.one_of({"/>", " />"}) + behind;
    return text + w.one_of({">", " >"}) + inside + "</" + tag + w.one_of({">", " >"}) + behind;
}

std::string xml_text(Writer& w) {
    const auto list = [&](std::initializer_list<double> v) {
        return w.numbers(v, w.one_of({", ", " ", ",", "  ", "\n"})) + w.one_of({"", " ", ", "});
    };
    const auto value = [&](const char* tag, const char* name, const std::string& v) {
        return xml_element(w, tag, {{"name", name}, {"value", v}});
    };
    const std::string corners = xml_element(
        w, "transform", {{"name", "to_world"}},
        xml_element(w, "translate", {{"x", w.number(0.5)}, {"y", w.number(-2)}, {"z", w.number(1e-3)}}) +
            xml_element(w, "matrix", {{"value", list({1, 0, 0, 0.25, 0, 1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1})}}));
    const std::string bsdf =
        xml_element(w, "bsdf", {{"type", "diffuse"}}, value("rgb", "reflectance", list({0.1, 0.25, 0.75})));
    const std::string light =
        xml_element(w, "emitter", {{"type", "point"}},
                    value("spectrum", "intensity",
                          w.one_of({"400:1, 500:2, 700:0.5", "400:1 500:2 700:.5", "400:1,500:2,700:0.5,"})) +
                        xml_element(w, "point", {{"name", "position"}, {"value", list({0, 1, 5})}}));
    const std::string head = w.one_of({"", "<?xml version='1.0'?>\n", "<!-- head -->\n", "\n"});
    return head + xml_element(w, "scene", {{"version", "3.0.0"}},
                              kSensor + xml_element(w, "shape", {{"type", "cube"}}, corners + bsdf) + light);
}

std::string pbrt_text(Writer& w) {
    const auto gap = [&] { return w.one_of({" ", "\n", "\t", "  ", " # \"a [comment\n", "\n#\n"}); };
    const auto list = [&](std::initializer_list<double> v) {
        return w.one_of({"[", "[ ", "[\n"}) + w.numbers(v, gap()) + w.one_of({"]", " ]", " # end\n]"});
    };
    const auto parameter = [&](const std::string& name, const std::string& v) {
        return gap() + "\"" + name + "\"" + gap() + v;
    };
    std::string uv = parameter("point2 uv", list({0, 0, 1, 0, 0, 1})),
                p = parameter("point3 P", list({0, 0, 0.5, 1, 0, 0.25, 0, 1, 1e-3}));
    if (w.pick(2)) std::swap(uv, p);
    return w.one_of({"", "# head\n", "\n"}) + "WorldBegin" + gap() + "LightSource" + gap() + "\"point\"" +
           parameter("rgb I", list({1, 2, 0.5})) + gap() + "Material" + gap() + "\"diffuse\"" +
           parameter("spectrum reflectance", w.one_of({"\"s.spd\"", "[\"s.spd\"]", "[ \"s.spd\" ]"})) + gap() +
           "Translate" + gap() + w.numbers({0.5, -2, 1e-3}, gap()) + gap() + "Shape" + gap() + "\"trianglemesh\"" + uv +
           p + parameter("integer indices", "[0 1 2]") + w.one_of({"\n", "", " # end"});
}

std::string spd_text(Writer& w) {
    const std::string gap = w.one_of({" ", "\t", "   "});
    std::string text = w.one_of({"", "# nm value\n", "\n"});
    for (const auto& [nm, v] : {std::pair{400, 0.25}, {500, 0.5}, {700, 0.75}})
        text += w.number(nm) + gap + w.number(v) + w.one_of({"\n", " \n", " # comment\n", "\n\n"});
    return text;
}

std::string gltf_text(Writer& w) {
    const auto gap = [&] { return w.one_of({"", " ", "\n", "\t"}); };
    const auto object = [&](std::vector<std::string> members) {
        if (!w.plain) std::shuffle(members.begin(), members.end(), w.random);
        std::string text;
        for (const std::string& m : members) text += (text.empty() ? "" : ",") + gap() + m + gap();
        return "{" + text + "}";
    };
    const std::string buffer =
        "\"uri\":\"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"";
    return object(
        {"\"asset\":" + object({"\"version\":\"2.0\""}), "\"scene\":0",
         "\"scenes\":[" + object({"\"nodes\":[0]"}) + "]",
         "\"nodes\":[" + object({"\"mesh\":0", "\"translation\":[0.5,-2,1" + w.one_of({"e-3", "E-3", "e-03"}) + "]"}) +
             "]",
         "\"meshes\":[{\"primitives\":[" + object({"\"attributes\":{\"POSITION\":0}", "\"material\":0"}) + "]}]",
         "\"materials\":[" +
             object({"\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.5,2.5e-1,1" + w.one_of({"", ".0", "e0"}) +
                     ",1]}"}) +
             "]",
         "\"buffers\":[" + object({"\"byteLength\":36", buffer}) + "]",
         "\"bufferViews\":[" + object({"\"buffer\":0", "\"byteLength\":36"}) + "]",
         "\"accessors\":[" +
             object({"\"bufferView\":0", "\"componentType\":5126", "\"count\":3", "\"type\":\"VEC3\"",
                     "\"min\":[0,0,0]", "\"max\":[1,1,0]"}) +
             "]"});
}

}  // namespace

TEST_CASE("Mitsuba XML, OBJ, ASCII PLY and spectra: every spelling of a scene is the same scene, to the bit") {
    const TempFolder folder;
    check_spellings([&](Writer& w) {
        folder.write("s.spd", w.file(spd_text(w)));
        folder.write("m.obj", w.file(obj_text(w)));
        folder.write("m.ply", w.file(ply_text(w)));
        std::string text = xml_text(w);
        const std::string more =
            "<shape type='obj'><string name='filename' value='m.obj'/><bsdf type='diffuse'><spectrum "
            "name='reflectance' "
            "filename='s.spd'/></bsdf></shape><shape type='ply'><string name='filename' value='m.ply'/></shape>";
        text.insert(text.find(kSensor), more);
        return load_mitsuba(folder.write("scene.xml", w.file(text, true)), {});
    });
}

TEST_CASE("pbrt and its spectra: every spelling of a scene is the same scene, to the bit") {
    const TempFolder folder;
    check_spellings([&](Writer& w) {
        folder.write("s.spd", w.file(spd_text(w)));
        return load_pbrt(folder.write("scene.pbrt", w.file(pbrt_text(w))), {});
    });
}

TEST_CASE("glTF: every spelling of a scene is the same scene, to the bit") {
    const TempFolder folder;
    check_spellings([&](Writer& w) { return load_scene_file(folder.write("scene.gltf", w.file(gltf_text(w))), {}); });
}

TEST_CASE("text in UTF-16 or UTF-32 is refused by that name, but XML may be UTF-16") {
    using namespace std::string_literals;
    for (const auto& [bytes, name] : {std::pair{"\xFF\xFEv\0 \0"s, "UTF-16LE"},
                                      {"\xFE\xFF\0v\0 "s, "UTF-16BE"},
                                      {"v\0 \0"s, "UTF-16LE"},
                                      {"\0v\0 "s, "UTF-16BE"},
                                      {"\xFF\xFE\0\0v\0\0\0"s, "UTF-32LE"},
                                      {"\0\0\xFE\xFF\0\0\0v"s, "UTF-32BE"},
                                      {"v\0\0\0"s, "UTF-32LE"},
                                      {"\0\0\0v"s, "UTF-32BE"}}) {
        CHECK(encoding_of(bytes) == name);
        const auto message = [&, b = bytes](const auto& read) -> std::string {
            try {
                read(b);
            } catch (const Error& e) {
                return e.what();
            }
            return "no error";
        };
        const std::string written = "written in "s + name;
        CHECK(contains(message([](const std::string& b) { read_obj("a", b, true); }), written));
        CHECK(contains(message([](const std::string& b) { read_ply("a", b, true); }), written));
        CHECK(contains(message([](const std::string& b) { read_curves("a", b); }), written));
        CHECK(contains(pbrt_error(bytes), written));
    }
    CHECK(plain_text_of_utf16("a", "\xFF\xFE\xE4\0=\xD8\x00\xDE"s) == "\xC3\xA4\xF0\x9F\x98\x80");
    CHECK(plain_text("a", kMark + "a\rb\r\nc\n\r") == "a\nb\nc\n\n");
}

TEST_CASE("text headers of binary files: PLY, HDR, PNM and PFM with every line end, also where data begin with one") {
    for (const std::string end : {"\n", "\r\n", "\r"}) {
        CAPTURE(end);
        const auto lines = [&](const std::string& text) {
            std::string out;
            for (char c : text) out += c == '\n' ? end : std::string(1, c);
            return out;
        };
        for (const std::string first : {"\n", "\r", "\r\n", "a"}) {
            std::string data = first + std::string(36 + 13 - first.size(), '\0');
            data.replace(36, 13, std::string("\3\0\0\0\0\1\0\0\0\2\0\0\0", 13));
            const std::string header = lines(
                "ply\nformat binary_little_endian 1.0\ncomment by hand\nelement vertex 3\nproperty float x\nproperty "
                "float y\n"
                "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n");
            float x = 0;
            for (const std::string& mark : {std::string(), kMark}) {
                const Mesh mesh = read_ply("a.ply", mark + header + data, false);
                memcpy(&x, data.data(), sizeof x);
                CHECK(mesh.positions.at(0).x == x);
                CHECK(mesh.faces.size() == 1);
            }
            std::string texels = first + std::string(18 - first.size(), 'b');
            const Texels image = read_image("a.ppm", lines("P6\n# comment\n3 2\n255\n") + texels);
            CHECK(char(image.bytes[0]) == texels[0]);
            const Texels floats = read_image("a.pfm", lines("PF\n1 1\n-1.0\n") + texels.substr(0, 12));
            memcpy(&x, texels.data(), sizeof x);
            CHECK(floats.floats[0] == x);
            texels.resize(8, 'c');
            const Texels hdr = read_image("a.hdr", lines("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n") + texels);
            CHECK(hdr.floats[0] == std::ldexp(float(uint8_t(texels[0])), int(uint8_t(texels[3])) - 136));
        }
    }
}
