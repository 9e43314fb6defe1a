// libs: ambilux_formats
// timeout: 60
// Meshes as glTF moves and colours them, and materials that files may do without.
#include "formats/images/image_write.h"
#include "tests/support/gltf_text.h"
#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using namespace ambilux::test::gltf;
using test::check_rgb;
using test::contains;
using test::has_note;

namespace {

Vec3f position(const Scene& s, size_t i) { return s.vertices[i].p; }

const BsdfRecord& bsdf(const Scene& s) { return s.bsdfs[s.materials[s.shapes[0].material].front]; }

const auto& principled(const Scene& s) { return bsdf(s).as<Principled>(); }

const Texture& texture_of(const Scene& s, const ParamRgb& value) {
    REQUIRE(value.texture >= 0);
    return s.textures[size_t(value.texture)];
}

std::string grey_png(uint8_t left, uint8_t right) { return png_bytes(2, 1, {left, left, left, right, right, right}); }

}  // namespace

TEST_CASE("joints move the vertices of a skin, and its node does not") {
    Json j = quad_scene();
    // Corners 0 and 1 hang on the first joint, 3 on the second, 2 on both.
    attributes(j)["JOINTS_0"] =
        add_accessor<uint8_t>(j, {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, "VEC4", kByte, 4);
    attributes(j)["WEIGHTS_0"] =
        add_accessor<float>(j, {1, 0, 0, 0, 1, 0, 0, 0, .5f, .5f, 0, 0, 1, 0, 0, 0}, "VEC4", kFloat, 4);
    const int bind = add_accessor<float>(
        j, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1}, "MAT4",
        kFloat, 2);
    j["skins"] = {{{"joints", {2, 3}}, {"inverseBindMatrices", bind}}};
    j["nodes"][0]["skin"] = 0;
    j["nodes"][0]["translation"] = {100, 0, 0};
    // The second joint stands at (0,1,0) on the first and turns x into z.
    j["nodes"].push_back({{"children", {3}}, {"translation", {0, 0, -5}}});
    j["nodes"].push_back({{"translation", {0, 1, 0}}, {"rotation", {0, -std::sqrt(0.5), 0, std::sqrt(0.5)}}});
    j["scenes"][0]["nodes"].push_back(2);
    const Scene s = load(j);
    check_rgb(position(s, 0), {-1, -1, -5});
    check_rgb(position(s, 1), {1, -1, -5});
    check_rgb(position(s, 3), {0, 1, -6});  // (-1,1,0): (-1,0,0) from the joint, turned to (0,0,-1)
    check_rgb(position(s, 2), {0.5f, 1, -4.5f});

    attributes(j)["WEIGHTS_0"] = add_accessor<float>(j, std::vector<float>(16, 0.0f), "VEC4", kFloat, 4);
    const Scene loose = load(j);
    CHECK(has_note(loose, "vertices without weights follow their first joint"));
    check_rgb(position(loose, 3), {0, 1, -6});
    j["skins"][0]["joints"] = {2};
    attributes(j)["JOINTS_0"] = add_accessor<uint8_t>(j, std::vector<uint8_t>(16, 1), "VEC4", kByte, 4);
    CHECK(contains(error_of(j), "JOINTS_0: index 1 of 1"));
    attributes(j)["JOINTS_0"] = add_accessor<float>(j, std::vector<float>(16, -4e26f), "VEC4", kFloat, 4);
    CHECK(contains(error_of(j), "JOINTS_0: index -4e+26 of 1"));
}

TEST_CASE("indices of vertices that are no whole numbers, or beyond all integers, are refused") {
    for (const auto& [index, told] : {std::pair{1.9f, "1.9"}, {-3.7e26f, "-3.7e+26"}, {4.0f, "4"}, {NAN, "nan"}}) {
        Json j = quad_scene();
        j["meshes"][0]["primitives"][0]["indices"] = add_accessor<float>(j, {0, 1, index}, "SCALAR", kFloat, 3);
        CHECK(contains(error_of(j), std::string("indices: index ") + told + " of 4"));
    }
}

TEST_CASE("morph targets by the weights of the mesh, or of its node") {
    Json j = quad_scene();
    const int by = add_accessor<float>(j, {0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4}, "VEC3", kFloat, 4);
    j["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", by}}};
    check_rgb(position(load(j), 1), {1, -1, 0});
    j["meshes"][0]["weights"] = {0.5};
    check_rgb(position(load(j), 1), {1, -1, 1});
    j["nodes"][0]["weights"] = {0.25};
    check_rgb(position(load(j), 1), {1, -1, 0.5f});
}

TEST_CASE("sparse accessors put values in the place of others, or of zeros") {
    Json j = quad_scene();
    const int at = add_accessor<uint16_t>(j, {2}, "SCALAR", kShort, 1),
              to = add_accessor<float>(j, {7, 8, 9}, "VEC3", kFloat, 1);
    const auto view = [&](int accessor) { return j["accessors"][size_t(accessor)]["bufferView"]; };
    const Json sparse = {{"count", 1},
                         {"indices", {{"bufferView", view(at)}, {"componentType", kShort}}},
                         {"values", {{"bufferView", view(to)}}}};
    j["accessors"][0]["sparse"] = sparse;
    check_rgb(position(load(j), 2), {7, 8, 9});
    check_rgb(position(load(j), 1), {1, -1, 0});
    Json zeros = j;
    zeros["accessors"][0].erase("bufferView");
    check_rgb(position(load(zeros), 2), {7, 8, 9});
    check_rgb(position(load(zeros), 0), {0, 0, 0});
    j["accessors"][0]["sparse"]["count"] = 5;
    CHECK(contains(error_of(j), "more sparse values than elements"));
    j["accessors"][0]["sparse"]["count"] = 1;
    j["accessors"][size_t(at)]["count"] = 1;
    j["accessors"][0]["sparse"]["values"]["byteOffset"] = 4;
    CHECK(contains(error_of(j), "beyond its buffer"));
}

TEST_CASE("colours of vertices are factors of the base colour") {
    Json j = quad_scene();
    Json same = j;
    attributes(same)["COLOR_0"] = add_accessor<uint8_t>(
        same, {255, 0, 51, 0, 255, 0, 51, 0, 255, 0, 51, 0, 255, 0, 51, 0}, "VEC3", kByte, 4, true);
    same["bufferViews"].back()["byteStride"] = 4;
    check_rgb(principled(load(same)).base_color.value, {0.5f, 0, 0.2f * 0.7f});

    attributes(j)["COLOR_0"] =
        add_accessor<float>(j, {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1}, "VEC4", kFloat, 4);
    const Scene s = load(j);
    CHECK(principled(s).base_color.texture >= 0);
    check_rgb(principled(s).base_color.value, {0.5f, 0.6f, 0.7f});

    j["images"] = {{{"uri", data_uri("image/png", grey_png(10, 200))}}};
    j["textures"] = {{{"source", 0}}};
    j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    // Beside a texture, by the mean of each triangle: (1, 0, 0), (0, 1, 0), (0, 0, 1) and (1, 0, 0), (0, 0, 1), white.
    const Scene beside = load(j);
    CHECK(has_note(beside, "are averaged over each triangle"));
    REQUIRE(beside.shapes.size() == 2);
    std::vector<Rgb> colors;
    for (const Shape& shape : beside.shapes) {
        const ParamRgb& c = beside.bsdfs[beside.materials[shape.material].front].as<Principled>().base_color;
        CHECK(c.texture >= 0);
        colors.push_back(c.value);
    }
    if (colors[0].x > colors[1].x) std::swap(colors[0], colors[1]);
    check_rgb(colors[0], {0.5f / 3, 0.6f / 3, 0.7f / 3});
    check_rgb(colors[1], {0.5f * 2 / 3, 0.6f / 3, 0.7f * 2 / 3});
    attributes(j)["COLOR_0"] = add_accessor<float>(j, {1, 0, 0, 0, 1, 0}, "VEC3", kFloat, 2);
    CHECK(contains(error_of(j), "COLOR_0: its size is not that of the primitive"));
}

TEST_CASE("instances of a mesh, lines beside triangles, nodes without a scene") {
    Json j = quad_scene();
    const int places = add_accessor<float>(j, {0, 0, 0, 5, 0, 0, 0, 0, -7}, "VEC3", kFloat, 3),
              sizes = add_accessor<float>(j, {1, 1, 1, 2, 2, 2, 1, 1, 1}, "VEC3", kFloat, 3);
    j["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", places}, {"SCALE", sizes}};
    j["extensionsUsed"] = j["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
    const Scene s = load(j);
    REQUIRE(s.shapes.size() == 3);
    check_rgb(position(s, 4), {3, -2, 0});
    check_rgb(position(s, 8), {-1, -1, -7});

    Json lines = quad_scene();
    lines["meshes"][0]["primitives"].push_back(lines["meshes"][0]["primitives"][0]);
    lines["meshes"][0]["primitives"][1]["mode"] = 1;
    CHECK(has_note(load(lines), "points and lines have no surface"));
    lines["meshes"][0]["primitives"][0]["mode"] = 0;
    CHECK(contains(error_of(lines), "it shows no triangles"));

    Json loose = quad_scene();
    loose.erase("scene"), loose.erase("scenes");
    CHECK(load(loose).triangles.size() == 2);
    loose["asset"]["version"] = "1.0";
    CHECK(contains(error_of(loose), "it is glTF 1.0"));
}

TEST_CASE("what a file may be shown without is left out with a note") {
    Json j = quad_scene();
    j["extensionsUsed"] = {"KHR_materials_unlit", "KHR_materials_iridescence", "KHR_materials_variants"};
    j["materials"][0]["extensions"] = {{"KHR_materials_unlit", Json::object()},
                                       {"KHR_materials_iridescence", {{"iridescenceFactor", 1}}}};
    const Scene s = load(j);
    CHECK(has_note(s, "unlit surfaces are lit"));
    CHECK(has_note(s, "'KHR_materials_iridescence' is left out, which the file allows"));
    CHECK(has_note(s, "'KHR_materials_variants' is left out, which the file allows"));
    j["extensionsRequired"] = {"KHR_materials_variants"};
    CHECK(contains(error_of(j), "extension 'KHR_materials_variants' is not supported"));
}

TEST_CASE("a property or an extension of another name is told, with the one that it nearly is") {
    const auto note_of = [](const std::function<void(Json&)>& change) {
        Json j = quad_scene();
        change(j);
        std::string all;
        for (const std::string& note : load(j).notes) all += note + "\n";
        return all;
    };
    CHECK_FALSE(contains(note_of([](Json&) {}), "left out"));
    CHECK(
        contains(note_of([](Json& j) { j["materials"][0]["pbrMetallicRoughness"]["baseColourFactor"] = 1; }),
                 "property 'baseColourFactor' of pbrMetallicRoughness is not known and left out: 'baseColorFactor' is "
                 "known"));
    CHECK(contains(note_of([](Json& j) { j["nodes"][0]["trnslation"] = {1, 2, 3}; }),
                   "property 'trnslation' of node is not known and left out: 'translation' is known"));
    CHECK(contains(note_of([](Json& j) { j["cameras"][0]["perspective"]["fieldOfView"] = 1; }),
                   "property 'fieldOfView' of perspective is not known and left out\n"));
    CHECK(contains(
        note_of([](Json& j) { j["materials"][0]["extensions"]["KHR_materials_clearcoat"] = {{"clearcoatFactr", 1}}; }),
        "'clearcoatFactr' of KHR_materials_clearcoat is not known and left out: 'clearcoatFactor' is known"));
    CHECK(contains(note_of([](Json& j) { j["extensionsUsed"] = {"KHR_materials_iorr"}; }),
                   "extension 'KHR_materials_iorr' is left out, which the file allows: 'KHR_materials_ior' is known"));
    CHECK(contains(note_of([](Json& j) { j["materials"][0]["extensions"]["EXT_thing"] = {{"a", 1}}; }),
                   "extension 'EXT_thing' is left out"));
    // Letters may be written by their numbers, and names may hold what JSON is made of.
    const test::TempFolder folder;
    const auto notes_of = [&](const std::string& key) {
        std::string text = quad_scene().dump();
        text.replace(text.find("\"materials\""), 11, "\"materials\"\n\t");
        text.replace(text.find("\"metallicFactor\""), 16, "\"name\" : \"a \\\"b\\\": {[ \\\\\",\"" + key + "\" ");
        std::string all;
        for (const std::string& note : load_scene_file(folder.write("a.gltf", text), {}).notes) all += note + "\n";
        return all;
    };
    CHECK_FALSE(contains(notes_of("met\\u0061llicFactor"), "left out"));
    CHECK(contains(notes_of("met\\u0061llicFactr"),
                   "property 'metallicFactr' of pbrMetallicRoughness is not known and left out: 'metallicFactor'"));
    // What is the author's own.
    CHECK_FALSE(contains(note_of([](Json& j) {
                             j["materials"][0]["extras"]["mine"] = {{"color", 1}};
                             j["materials"][0]["name"] = "a";
                             j["meshes"][0]["primitives"][0]["attributes"]["_MINE"] = 0;
                         }),
                         "left out"));
    Json required = quad_scene();
    required["extensionsRequired"] = {"KHR_texture_transfrom"};
    CHECK(contains(error_of(required), "'KHR_texture_transfrom' is not supported: 'KHR_texture_transform' is known"));
}

TEST_CASE("scaled normals, means of textures, modes of the two axes") {
    Json j = quad_scene();
    j["images"] = {{{"uri", data_uri("image/png", png_bytes(1, 1, {204, 128, 230}))}},
                   {{"uri", data_uri("image/png", grey_png(51, 153))}}};
    j["textures"] = {{{"source", 0}}, {{"source", 1}, {"sampler", 0}}, {{"sampler", 0}}};
    j["samplers"] = {{{"wrapS", 33648}, {"wrapT", 10497}}};
    Json bumpy = j;
    bumpy["materials"][0]["normalTexture"] = {{"index", 0}, {"scale", 2}};
    const Scene s = load(bumpy);
    REQUIRE(bsdf(s).normal_map >= 0);
    const float x = 2 * 204 / 255.0f - 1, y = 2 * 128 / 255.0f - 1, z = 2 * 230 / 255.0f - 1,
                l = std::sqrt(4 * x * x + 4 * y * y + z * z);
    check_rgb(load_texel(s.view(), s.textures[size_t(bsdf(s).normal_map)], 0, 0),
              {0.5f + x / l, 0.5f + y / l, 0.5f + z / l / 2}, 1e-3);

    Json coated = j;
    coated["materials"][0]["extensions"]["KHR_materials_clearcoat"] = {{"clearcoatFactor", 0.5},
                                                                       {"clearcoatTexture", {{"index", 1}}}};
    coated["extensionsUsed"] = {"KHR_materials_clearcoat"};
    CHECK(principled(load(coated)).clearcoat == Approx(0.5 * 0.4));
    CHECK(has_note(load(coated), "clearcoatTexture counts by its mean"));

    // Coordinates within [0, 1] take the other axis's mode, others a mirrored image.
    const auto base = [](Json file) -> Json {
        file["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 1}};
        return file;
    };
    const Scene inside = load(base(j));
    CHECK(texture_of(inside, principled(inside).base_color).width == 2);
    attributes(j)["TEXCOORD_0"] = add_accessor<float>(j, {0, 1, 3, 1, 3, -2, 0, -2}, "VEC2", kFloat, 4);
    const Scene outside = load(base(j));
    const Texture& t = texture_of(outside, principled(outside).base_color);
    CHECK(t.width == 4);
    CHECK(t.wrap == WrapMode::repeat);
    Json clamped = base(j);
    clamped["samplers"][0]["wrapS"] = 33071;
    CHECK(contains(error_of(clamped), "different wrap modes"));

    Json empty = j;
    empty["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 2}};
    CHECK(has_note(load(empty), "texture 2 has no image"));
    empty["textures"][2]["extensions"]["KHR_texture_basisu"] = {{"source", 0}};
    CHECK(contains(error_of(empty), "extension 'KHR_texture_basisu'"));
}

TEST_CASE("what a few bytes ask for is counted") {
    // Accessors without a buffer view are zeros, as many as they say.
    Json j = quad_scene();
    const auto view_of = [&j](int accessor) { return j["accessors"][size_t(accessor)]["bufferView"]; };
    const Json value = view_of(add_accessor<float>(j, {1, 0, 0}, "VEC3", kFloat, 1)),
               place = view_of(add_accessor<uint8_t>(j, {0}, "SCALAR", kByte, 1));
    const Json sparse = {{"count", 1},
                         {"indices", {{"bufferView", place}, {"componentType", kByte}}},
                         {"values", {{"bufferView", value}}}};
    j["accessors"].push_back({{"componentType", kFloat}, {"count", 30000000}, {"type", "VEC3"}, {"sparse", sparse}});
    j["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = j["accessors"].size() - 1;
    CHECK(contains(error_of(j), "--limits bytes"));

    // Images that are made of others: two scales of one map of normals.
    Json maps = quad_scene();
    maps["images"] = {{{"uri", data_uri("image/png", grey_png(0, 255))}}};
    maps["textures"] = {{{"source", 0}}};
    maps["materials"].push_back(maps["materials"][0]);
    for (size_t i = 0; i < 2; ++i) maps["materials"][i]["normalTexture"] = {{"index", 0}, {"scale", 2.0 + double(i)}};
    Json second = maps["meshes"][0]["primitives"][0];
    second["material"] = 1;
    maps["meshes"][0]["primitives"].push_back(second);
    LoadOptions options;
    options.limits.total_bytes = 50;
    CHECK(contains(error_of(maps, options), "with it, textures take more memory than --limits total_bytes=50"));
}

TEST_CASE("colours of vertices that differ by little are two") {
    Json j = quad_scene();
    Json second = j["meshes"][0]["primitives"][0];
    const auto colored = [&j](float v) { return add_accessor<float>(j, std::vector<float>(12, v), "VEC3", kFloat, 4); };
    second["attributes"]["COLOR_0"] = colored(2e-8f);
    attributes(j)["COLOR_0"] = colored(1e-8f);
    j["meshes"][0]["primitives"].push_back(second);
    const Scene s = load(j);
    REQUIRE(s.shapes.size() == 2);
    CHECK(s.shapes[0].material != s.shapes[1].material);
}
