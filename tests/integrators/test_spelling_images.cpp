// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel
// timeout: 120
// One scene in other words: order of elements, nesting, references, parts in other files, and the three formats where
// they can say the same. Bits may differ; contents and expected images may not.
#include <fmt/format.h>

#include <random>

#include "formats/document/transform.h"
#include "scene/info.h"
#include "tests/support/closed_forms.h"
#include "tests/support/gltf_text.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using document::Matrix;
using test::TempFolder;
using Json = nlohmann::json;

namespace {

constexpr uint32_t kWidth = 24, kHeight = 16;
constexpr double kFov = 40, kNear = 1e-5, kFar = 1e10;
constexpr int kDepth = 6;

/// A square or a sphere of a colour: scaled, turned about z and then y, and moved.
struct Thing {
    bool is_sphere;
    Rgb color;
    double scale[2], about_z, about_y, place[3];

    Matrix scaled() const { return document::scaling(scale[0], scale[1], is_sphere ? scale[0] : 1); }
    Matrix turned(bool y) const { return document::rotation(0, y, !y, y ? about_y : about_z); }
    Matrix moved() const { return document::translation(place[0], place[1], place[2]); }
    Matrix whole() const { return moved() * turned(true) * turned(false) * scaled(); }
};

struct Lamp {
    Rgb intensity;
    double place[3];
};

/// What all spellings say. `metallic`: surfaces are principled, as those of glTF are, and diffuse otherwise.
struct Contents {
    std::vector<Thing> things;
    std::vector<Lamp> lamps;
    bool metallic;
};

Contents random_contents(uint32_t seed, bool metallic) {
    std::mt19937 random(seed);
    const auto number = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
    const auto color = [&](double low, double high) {
        return Rgb{float(number(low, high)), float(number(low, high)), float(number(low, high))};
    };
    Contents out{{}, {}, metallic};
    // A wall behind all, so that light is passed on.
    out.things.push_back({false, color(0.3, 0.9), {3, 2}, 0, 0, {0, 0, -1}});
    for (int i = 0; i < 4; ++i) {
        const double size = number(0.3, 0.7);
        const bool is_sphere = !metallic && i % 2;
        out.things.push_back({is_sphere,
                              color(0.1, 0.9),
                              {size, is_sphere ? size : number(0.3, 0.9)},
                              number(0, 90),
                              number(-60, 60),
                              {number(-1.5, 1.5), number(-1, 1), number(-0.5, 0.5)}});
    }
    for (int i = 0; i < 2; ++i) out.lamps.push_back({color(2, 8), {number(-2, 2), number(-2, 2), number(2, 4)}});
    return out;
}

/// Chooses among ways to say the same; the plain one is always the first.
struct Words {
    std::mt19937 random;
    bool plain = false;

    bool other() { return !plain && random() % 2; }
    template <class T>
    std::vector<T> in_any_order(std::vector<T> all) {
        if (!plain) std::shuffle(all.begin(), all.end(), random);
        return all;
    }
};

std::string joined(const std::vector<std::string>& parts) {
    std::string all;
    for (const std::string& part : parts) all += part + "\n";
    return all;
}

std::string text_of(Rgb c) { return fmt::format("{} {} {}", c.x, c.y, c.z); }

std::string xml_matrix(const Matrix& m) {
    std::string text;
    for (const auto& row : m.m)
        for (const double v : row) text += fmt::format("{} ", v);
    return "<matrix value='" + text + "'/>";
}

std::string xml_transform(Words& w, const Thing& t) {
    const std::string steps =
        w.other() ? xml_matrix(t.whole())
                  : fmt::format(
                        "<scale x='{}' y='{}' z='{}'/><rotate z='1' angle='{}'/><rotate y='1' angle='{}'/>"
                        "<translate x='{}' y='{}' z='{}'/>",
                        t.scale[0], t.scale[1], t.is_sphere ? t.scale[0] : 1, t.about_z, t.about_y, t.place[0],
                        t.place[1], t.place[2]);
    return "<transform name='to_world'>" + steps + "</transform>";
}

/// Its surface in place, or one that stands elsewhere, which goes to `elsewhere`.
std::string xml_surface(Words& w, const Contents& c, const Thing& t, size_t index,
                        std::vector<std::string>& elsewhere) {
    const auto here_or_there = [&](const std::string& bsdf, const std::string& id) {
        if (!w.other()) return "<bsdf " + bsdf;
        elsewhere.push_back("<bsdf id='" + id + "' " + bsdf);
        return "<ref id='" + id + "'/>";
    };
    const std::string color = text_of(t.color);
    const std::string one_side =
        c.metallic ? fmt::format(
                         "type='principled'>{}</bsdf>",
                         joined(w.in_any_order<std::string>(
                             {"<rgb name='base_color' value='" + color + "'/>", "<float name='metallic' value='0.25'/>",
                              "<float name='roughness' value='0.5'/>", "<float name='eta' value='1.5'/>"})))
                   : "type='diffuse'><rgb name='reflectance' value='" + color + "'/></bsdf>";
    const std::string inner = here_or_there(one_side, fmt::format("side{}", index));
    return here_or_there("type='twosided'>" + inner + "</bsdf>", fmt::format("surface{}", index));
}

void add_xml_shape(Words& w, const Contents& c, size_t index, std::vector<std::string>& out) {
    const Thing& t = c.things[index];
    const std::string type = t.is_sphere ? "sphere" : "rectangle", surface = xml_surface(w, c, t, index, out);
    if (!w.other()) {
        out.push_back("<shape type='" + type + "'>" +
                      joined(w.in_any_order<std::string>({xml_transform(w, t), surface})) + "</shape>");
        return;
    }
    // In a group, which has one place.
    const std::string id = fmt::format("group{}", index),
                      group = "<shape type='shapegroup' id='" + id + "'><shape type='" + type +
                              "'><transform name='to_world'>" + xml_matrix(t.turned(false) * t.scaled()) +
                              "</transform>" + surface + "</shape></shape>";
    out.push_back(group);
    out.push_back("<shape type='instance'><transform name='to_world'>" + xml_matrix(t.moved() * t.turned(true)) +
                  "</transform><ref id='" + id + "'/></shape>");
}

Scene load_xml(Words w, const Contents& c, const TempFolder& folder) {
    std::vector<std::string> parts;
    for (size_t i = 0; i < c.things.size(); ++i) add_xml_shape(w, c, i, parts);
    for (const Lamp& lamp : c.lamps)
        parts.push_back(
            fmt::format("<emitter type='point'><rgb name='intensity' value='{}'/><point name='position' "
                        "x='{}' y='{}' z='{}'/></emitter>",
                        text_of(lamp.intensity), lamp.place[0], lamp.place[1], lamp.place[2]));
    parts = w.in_any_order(parts);
    if (w.other()) {  // some of them in another file
        const ptrdiff_t half = ptrdiff_t(parts.size() / 2);
        folder.write("part.xml",
                     "<scene version='3.0.0'>" + joined({parts.begin(), parts.begin() + half}) + "</scene>");
        parts.erase(parts.begin(), parts.begin() + half);
        parts.push_back("<include filename='part.xml'/>");
    }
    std::vector<std::string> of_sensor = {
        fmt::format("<float name='fov' value='{}'/><string name='fov_axis' value='y'/>", kFov),
        fmt::format("<float name='near_clip' value='{}'/><float name='far_clip' value='{}'/>", kNear, kFar),
        fmt::format("<film type='hdrfilm'><integer name='width' value='{}'/><integer name='height' value='{}'/></film>",
                    kWidth, kHeight),
        "<transform name='to_world'>" +
            (w.other() ? "<rotate y='1' angle='180'/><translate z='6'/>"
                       : std::string("<lookat origin='0,0,6' target='0,0,0' up='0,1,0'/>")) +
            "</transform>"};
    if (!c.metallic) {  // glTF says neither how many samples there are, nor how long paths may be
        of_sensor.push_back("<sampler type='independent'><integer name='sample_count' value='16'/></sampler>");
        parts.push_back(
            fmt::format("<integrator type='path'><integer name='max_depth' value='{}'/></integrator>", kDepth));
    }
    parts.push_back("<sensor type='perspective'>" + joined(w.in_any_order(of_sensor)) + "</sensor>");
    return load_mitsuba(
        folder.write("scene.xml", "<scene version='3.0.0'>" + joined(w.in_any_order(parts)) + "</scene>"), {});
}

std::string pbrt_matrix(const Matrix& m) {
    std::string text = "ConcatTransform [";
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) text += fmt::format(" {}", m.m[i][j]);
    return text + " ]";
}

std::string pbrt_thing(Words& w, const Thing& t, size_t index) {
    const std::string turns = fmt::format("Rotate {} 0 0 1 Scale {} {} {}", t.about_z, t.scale[0], t.scale[1],
                                          t.is_sphere ? t.scale[0] : 1),
                      moves = fmt::format("Translate {} {} {} Rotate {} 0 1 0 ", t.place[0], t.place[1], t.place[2],
                                          t.about_y);
    const std::string reflectance = "\"rgb reflectance\" [" + text_of(t.color) + "]",
                      name = fmt::format("\"m{}\"", index);
    const std::string material = w.other() ? "MakeNamedMaterial " + name + " \"string type\" \"diffuse\" " +
                                                 reflectance + " NamedMaterial " + name + "\n"
                                           : "Material \"diffuse\" " + reflectance + "\n";
    const std::string shape = t.is_sphere
                                  ? "Shape \"sphere\"\n"
                                  : "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] \"point2 uv\" "
                                    "[0 0 1 0 1 1 0 1] \"integer indices\" [0 1 2 0 2 3]\n";
    if (!w.other())
        return "AttributeBegin " + (w.other() ? material + moves + turns : moves + turns + "\n" + material) + "\n" +
               shape + "AttributeEnd";
    const std::string object = fmt::format("\"o{}\"", index);
    return "AttributeBegin ObjectBegin " + object + "\n" + material + turns + "\n" + shape + "ObjectEnd\n" +
           (w.other() ? moves : pbrt_matrix(t.moved() * t.turned(true))) + "\nObjectInstance " + object +
           " AttributeEnd";
}

Scene load_pbrt_words(Words w, const Contents& c, const TempFolder& folder) {
    std::vector<std::string> world, options = {fmt::format("Integrator \"path\" \"integer maxdepth\" {}", kDepth - 1),
                                               fmt::format("Film \"rgb\" \"integer xresolution\" {} \"integer "
                                                           "yresolution\" {}",
                                                           kWidth, kHeight),
                                               "Sampler \"independent\" \"integer pixelsamples\" 16"};
    for (size_t i = 0; i < c.things.size(); ++i) world.push_back(pbrt_thing(w, c.things[i], i));
    for (const Lamp& lamp : c.lamps) {
        const std::string place = fmt::format("{} {} {}", lamp.place[0], lamp.place[1], lamp.place[2]),
                          light = "LightSource \"point\" \"rgb I\" [" + text_of(lamp.intensity) + "] ";
        world.push_back(w.other() ? "AttributeBegin Translate " + place + " " + light + " AttributeEnd"
                                  : light + "\"point3 from\" [" + place + "]");
    }
    world = w.in_any_order(world);
    if (w.other()) {
        folder.write("part.pbrt", world.back());
        world.back() = "Include \"part.pbrt\"";
    }
    const std::string camera =
        fmt::format("Scale -1 1 1 LookAt 0 0 6  0 0 0  0 1 0 Camera \"perspective\" \"float fov\" {}", kFov);
    options.insert(options.begin(), camera);
    return load_pbrt(folder.write("scene.pbrt", joined(w.in_any_order(options)) + "WorldBegin\n" + joined(world)), {});
}

Json numbers_of(const Matrix& m) {
    Json out = Json::array();
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) out.push_back(m.m[i][j]);
    return out;
}

Json turn_about(int axis, double degrees) {
    Json out = {0, 0, 0, std::cos(degrees * (M_PI / 360))};
    out[size_t(axis)] = std::sin(degrees * (M_PI / 360));
    return out;
}

/// A node of a matrix, or two of steps, of which the outer one is the root. Returns the root.
size_t add_nodes(Words& w, const Thing& t, size_t mesh, Json& nodes) {
    if (w.other()) {
        nodes.push_back({{"matrix", numbers_of(t.whole())}, {"mesh", mesh}});
        return nodes.size() - 1;
    }
    nodes.push_back({{"rotation", turn_about(2, t.about_z)}, {"scale", {t.scale[0], t.scale[1], 1}}, {"mesh", mesh}});
    nodes.push_back(
        {{"translation", t.place}, {"rotation", turn_about(1, t.about_y)}, {"children", {nodes.size() - 1}}});
    return nodes.size() - 1;
}

Scene load_gltf_words(Words w, const Contents& c, const TempFolder& folder) {
    Json j = {{"asset", {{"version", "2.0"}}},
              {"extensionsUsed", {"KHR_lights_punctual"}},
              {"cameras",
               {{{"type", "perspective"},
                 {"perspective", {{"yfov", kFov * (M_PI / 180)}, {"aspectRatio", 1.5}, {"znear", kNear}}}}}},
              {"nodes", {{{"camera", 0}, {"translation", {0, 0, 6}}}}}};
    const int positions = test::gltf::add_accessor<float>(j, {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, "VEC3",
                                                          test::gltf::kFloat, 4),
              uvs = test::gltf::add_accessor<float>(j, {0, 0, 1, 0, 1, 1, 0, 1}, "VEC2", test::gltf::kFloat, 4),
              indices = test::gltf::add_accessor<uint16_t>(j, {0, 1, 2, 0, 2, 3}, "SCALAR", test::gltf::kShort, 6);
    std::vector<size_t> roots = {0};
    for (const Thing& t : w.in_any_order(c.things)) {
        const size_t index = j.value("meshes", Json::array()).size();
        j["materials"].push_back({{"pbrMetallicRoughness",
                                   {{"baseColorFactor", {t.color.x, t.color.y, t.color.z, 1}},
                                    {"metallicFactor", 0.25},
                                    {"roughnessFactor", 0.5}}}});
        j["meshes"].push_back({{"primitives",
                                {{{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uvs}}},
                                  {"indices", indices},
                                  {"material", index}}}}});
        roots.push_back(add_nodes(w, t, index, j["nodes"]));
    }
    for (const Lamp& lamp : w.in_any_order(c.lamps)) {
        Json& lights = j["extensions"]["KHR_lights_punctual"]["lights"];
        const float most = w.other() ? max_component(lamp.intensity) : 1;
        const Rgb color = lamp.intensity / most;
        lights.push_back({{"type", "point"}, {"color", {color.x, color.y, color.z}}, {"intensity", most}});
        roots.push_back(j["nodes"].size());
        j["nodes"].push_back(
            {{"translation", lamp.place}, {"extensions", {{"KHR_lights_punctual", {{"light", lights.size() - 1}}}}}});
    }
    roots = w.in_any_order(roots);
    if (w.other()) {
        j["nodes"].push_back({{"children", roots}});
        roots = {j["nodes"].size() - 1};
    }
    j["scenes"] = {{{"nodes", roots}}};
    LoadOptions options;
    options.width = kWidth, options.height = kHeight;
    return load_scene_file(folder.write("scene.gltf", j.dump()), options);
}

/// Of `info`, what does not depend on words: notes tell of these, and surfaces may be shared.
Json contents_of(const Scene& scene) {
    Json info = scene_info(scene);
    for (const char* of_words : {"scene", "content_hash", "materials", "memory_bytes", "notes"}) info.erase(of_words);
    for (auto& count : info["bsdfs"]) count = 1;
    return info.flatten();
}

void check_contents(const Scene& scene, const Scene& plain) {
    const Json a = contents_of(scene), b = contents_of(plain);
    REQUIRE(a.size() == b.size());
    for (const auto& [name, value] : b.items()) {
        CAPTURE(name);
        REQUIRE(a.contains(name));
        if (value.is_number_float())
            CHECK(a[name].get<double>() == Approx(value.get<double>()).epsilon(1e-5).margin(1e-6));
        else
            CHECK(a[name] == value);
    }
    CHECK(scene.warnings.empty());
}

void check_images(const Scene& scene, const Scene& plain) {
    ZTestOptions options;
    options.block = 4;
    options.rounding = 1e-4;
    const auto image = [](const Scene& s, uint64_t seed) {
        return to_estimate(render_scene(s, cpu_settings(s, Estimator::mis, seed), 128).film);
    };
    const ZTestResult z = z_test(image(scene, 1), image(plain, 2), options);
    INFO(z.report());
    CHECK(z.pass);
    CHECK(z.detectable < 0.05);
}

constexpr uint32_t kScenes = 12, kOthers = 10, kImages = 4;  ///< spellings of each scene, scenes whose images are made

/// Scenes by `load` in many words, and by its plain words, against the plain words of XML.
template <class Load>
void check_words(bool metallic, Load load) {
    const TempFolder folder, plain_folder;
    for (uint32_t seed = 1; seed <= kScenes; ++seed) {
        CAPTURE(seed);
        const Contents contents = random_contents(seed, metallic);
        const Scene plain = load_xml({std::mt19937(seed), true}, contents, plain_folder);
        REQUIRE(plain.shapes.size() == contents.things.size());
        for (uint32_t i = 0; i <= kOthers; ++i) {
            CAPTURE(i);
            const Scene scene = load(Words{std::mt19937(100 * seed + i), i == 0}, contents, folder);
            check_contents(scene, plain);
            if (seed <= kImages && i <= 1) check_images(scene, plain);
        }
    }
}

}  // namespace

TEST_CASE("XML: order of elements, references, groups, steps of transforms and included files change no scene") {
    check_words(false, load_xml);
    check_words(true, load_xml);
}

TEST_CASE("pbrt says the same scenes as XML, in any order and nesting") { check_words(false, load_pbrt_words); }

TEST_CASE("glTF says the same scenes as XML, in any order and nesting") { check_words(true, load_gltf_words); }
