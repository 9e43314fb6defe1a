// libs: ambilux_render ambilux_integrators ambilux_film ambilux_convert ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 120
// What glTF scenes become, what is refused, files that lie, and the image of the same scene in Mitsuba's XML.
#include "formats/load.h"

#include <cstring>

#include "formats/convert/convert.h"
#include "tests/support/closed_forms.h"
#include "tests/support/gltf_text.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"

using namespace ambilux;
using test::check_rgb;
using test::contains;
using test::has_note;
using test::TempFolder;
using namespace ambilux::test::gltf;

namespace {

const BsdfRecord& bsdf(const Scene& s) { return s.bsdfs[s.materials[s.shapes[0].material].front]; }

void add_image(Json& j, const std::string& png) {
    j["images"] = {{{"uri", data_uri("image/png", png)}}};
    j["textures"] = {{{"source", 0}}};
}

Json with_light(Json j, const Json& light, const Json& node = Json::object()) {
    j["extensionsUsed"] = {"KHR_lights_punctual"};
    j["extensions"]["KHR_lights_punctual"]["lights"] = {light};
    Json n = node;
    n["extensions"]["KHR_lights_punctual"]["light"] = 0;
    j["nodes"].push_back(n);
    j["scenes"][0]["nodes"].push_back(j["nodes"].size() - 1);
    return j;
}

}  // namespace

TEST_CASE("a mesh, its material and the camera") {
    const Scene s = load(quad_scene());
    REQUIRE(s.triangles.size() == 2);
    CHECK((s.shapes[0].flags & (kShapeHasNormals | kShapeHasUvs)) == (kShapeHasNormals | kShapeHasUvs));
    const auto& p = bsdf(s).as<Principled>();
    check_rgb(p.base_color.value, {0.5f, 0.6f, 0.7f});
    CHECK(p.metallic.value == 0.25f);
    CHECK(p.roughness.value == 0.5f);
    CHECK(p.ior == 1.5f);
    CHECK(s.sensor.tan_half_fov.y == Approx(std::tan(0.45)));
    CHECK(s.sensor.film_width == 1080);
    check_rgb(s.sensor.to_world.vector({0, 0, 1}), {0, 0, -1});
    check_rgb(s.sensor.to_world.vector({1, 0, 0}), {-1, 0, 0});
    CHECK(has_note(s, "no light"));
}

TEST_CASE("nodes place their meshes: products of matrices, quaternions and scales") {
    Json j = quad_scene();
    j["nodes"][0] = {{"children", {2}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1}}};
    j["nodes"].push_back({{"mesh", 0}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}, {"scale", {2, 1, 1}}});
    const Scene s = load(j);
    check_rgb(s.vertices[1].p, {6, 2, 0});  // (1,-1,0): scaled (2,-1,0), turned (1,2,0), moved
    j["nodes"].push_back({{"mesh", 0}, {"scale", {-1, 1, 1}}});
    j["scenes"][0]["nodes"].push_back(3);
    const Scene mirrored = load(j);
    REQUIRE(mirrored.shapes.size() == 2);
    const Triangle& t = mirrored.triangles[2];
    const auto& v = mirrored.vertices;
    CHECK(cross(v[t.v1].p - v[t.v0].p, v[t.v2].p - v[t.v0].p).z > 0);
}

TEST_CASE("textures: colours are decoded, metal is blue, roughness green, rows run downwards") {
    Json j = quad_scene();
    add_image(j, png_bytes(2, 1, {255, 128, 64, 0, 255, 0}));
    Json& pbr = j["materials"][0]["pbrMetallicRoughness"];
    pbr = {{"baseColorTexture", {{"index", 0}}}, {"metallicRoughnessTexture", {{"index", 0}}}, {"metallicFactor", 0.5}};
    j["samplers"] = {{{"magFilter", 9728}, {"wrapS", 33071}, {"wrapT", 33071}}};
    j["textures"][0]["sampler"] = 0;
    const Scene s = load(j);
    const auto& p = bsdf(s).as<Principled>();
    const SceneView view = s.view();
    check_rgb(eval_rgb<kAllFeatures>(view, p.base_color, {0.25f, 0.5f}), {1, 0.21586f, 0.05127f}, 1e-4);
    CHECK(eval_float<kAllFeatures>(view, p.roughness, {0.25f, 0.5f}) == Approx(128 / 255.0f));
    CHECK(eval_float<kAllFeatures>(view, p.metallic, {0.25f, 0.5f}) == Approx(0.5f * 64 / 255));
    CHECK(s.textures[size_t(p.base_color.texture)].wrap == WrapMode::clamp);
    pbr["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {{"offset", {0.5, 0}}};
    const Scene moved = load(j);
    check_rgb(eval_rgb<kAllFeatures>(moved.view(), bsdf(moved).as<Principled>().base_color, {0.25f, 0.5f}), {0, 1, 0},
              1e-4);
}

TEST_CASE("alpha, emission, glass and panes") {
    Json j = quad_scene();
    Json& m = j["materials"][0];
    m["alphaMode"] = "BLEND";
    m["pbrMetallicRoughness"]["baseColorFactor"] = {0.5, 0.6, 0.7, 0.25};
    CHECK(load(j).materials[load(j).shapes[0].material].opacity.value == 0.25f);
    m["alphaMode"] = "MASK";
    CHECK(load(j).materials[load(j).shapes[0].material].opacity.value == 0);
    m["alphaMode"] = "OPAQUE";
    m["emissiveFactor"] = {1, 0.5, 0.25};
    m["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = 4;
    const Scene lit = load(j);
    REQUIRE(lit.emitters.size() == 1);
    check_rgb(lit.emitters[0].radiance.value, {4, 2, 1});
    // Alpha covers light as well: 0.25 of it is left, nothing of what is cut.
    m["alphaMode"] = "BLEND";
    check_rgb(load(j).emitters.at(0).radiance.value, {1, 0.5f, 0.25f});
    m["alphaMode"] = "MASK";
    CHECK(load(j).emitters.at(0).type != EmitterType::area);
    m["alphaMode"] = "BLEND";
    Json of_image = j;
    add_image(of_image, png_bytes(2, 1, {255, 128, 64, 0, 255, 0}));
    of_image["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    const Scene textured = load(of_image);
    check_rgb(eval_rgb<kAllFeatures>(textured.view(), textured.emitters.at(0).radiance, {0.25f, 0.5f}),
              {1, 0.5f, 0.25f}, 1e-3);
    m["alphaMode"] = "OPAQUE";
    m.erase("emissiveFactor");
    m["extensions"] = {{"KHR_materials_transmission", {{"transmissionFactor", 1.0}}}};
    m["pbrMetallicRoughness"] = {
        {"metallicFactor", 0}, {"roughnessFactor", 0.5}, {"baseColorFactor", {0.9, 0.8, 0.7, 1}}};
    const Scene pane = load(j);
    CHECK(bsdf(pane).type == BsdfType::thin_dielectric);
    check_rgb(bsdf(pane).as<ThinDielectric>().specular_transmittance.value, {0.9f, 0.8f, 0.7f});
    m["extensions"]["KHR_materials_volume"] = {{"thicknessFactor", 1.0}};
    m["extensions"]["KHR_materials_ior"] = {{"ior", 1.33}};
    const Scene glass = load(j);
    CHECK(bsdf(glass).type == BsdfType::rough_dielectric);
    CHECK(bsdf(glass).as<RoughDielectric>().alpha_u.value == 0.25f);
    CHECK(bsdf(glass).as<RoughDielectric>().ior == Approx(1.33f));
}

TEST_CASE("what shines and has two sides shines on both") {
    Json j = quad_scene();
    j["materials"][0]["emissiveFactor"] = {1, 2, 3};
    CHECK(load(j).emitters.size() == 1);
    j["materials"][0]["doubleSided"] = true;
    const Scene s = load(j);
    REQUIRE(s.emitters.size() == 2);
    REQUIRE(s.shapes.size() == 2);
    CHECK(has_note(s, "two-sided emissive surfaces become two"));
    CHECK(s.emitters[1].radiance.value == s.emitters[0].radiance.value);
    for (const MeshVertex& v : s.vertices) CHECK(v.p.z == Approx(v.n.z > 0 ? 0.0 : -2e-5).margin(1e-6));
    j["materials"][0]["alphaMode"] = "BLEND";
    CHECK(load(j).emitters.size() == 1);
}

TEST_CASE("specular factors and sheen, as Blender writes them") {
    const auto principled_of = [](const Json& extensions) {
        Json j = quad_scene();
        j["materials"][0]["extensions"] = extensions;
        const Scene s = load(j);
        return s.bsdfs[s.materials[s.shapes[0].material].front].as<Principled>();
    };
    CHECK(principled_of({{"KHR_materials_ior", {{"ior", 1.45}}}}).ior == Approx(1.45));
    CHECK(principled_of({{"KHR_materials_ior", {{"ior", 1.45}}}, {"KHR_materials_specular", {{"specularFactor", 1}}}})
              .ior == Approx(1.45));
    // Half of the reflectance at normal incidence, 0.04.
    const double root = std::sqrt(0.02);
    CHECK(principled_of({{"KHR_materials_specular", {{"specularFactor", 0.5}}}}).ior ==
          Approx((1 + root) / (1 - root)).epsilon(1e-5));
    CHECK(principled_of({{"KHR_materials_specular", {{"specularColorFactor", {0.5, 0.5, 0.5}}}}}).ior ==
          Approx((1 + root) / (1 - root)).epsilon(1e-5));
    CHECK(principled_of({{"KHR_materials_specular", {{"specularFactor", 0}}}}).ior == 1);
    // 0 stands for a Fresnel term of 1, which the specular colour scales.
    CHECK(principled_of({{"KHR_materials_ior", {{"ior", 0}}}}).ior == 1000);
    CHECK(principled_of({{"KHR_materials_ior", {{"ior", 0}}},
                         {"KHR_materials_specular", {{"specularColorFactor", {0.04, 0.04, 0.04}}}}})
              .ior == Approx(1.5).epsilon(1e-3));
    CHECK(principled_of({{"KHR_materials_sheen", {{"sheenColorFactor", {0.1, 0.3, 0.2}}}}}).sheen == Approx(0.3));
    Json j = quad_scene();
    j["materials"][0]["extensions"] = {{"KHR_materials_specular", {{"specularTexture", {{"index", 0}}}}}};
    CHECK(has_note(load(j), "specularTexture is left out: its factor counts"));
}

TEST_CASE("lights along -z of their nodes") {
    const Json turn = {{"translation", {0, 0, 2}}, {"rotation", {0, std::sqrt(0.5), 0, std::sqrt(0.5)}}};
    const Scene sun =
        load(with_light(quad_scene(), {{"type", "directional"}, {"intensity", 3}, {"color", {1, 0.5, 0.25}}}, turn));
    check_rgb(sun.emitters[0].direction, {-1, 0, 0});
    check_rgb(sun.emitters[0].radiance.value, {3, 1.5f, 0.75f});
    const Scene spot = load(with_light(
        quad_scene(),
        {{"type", "spot"}, {"intensity", 3}, {"spot", {{"innerConeAngle", 0.2}, {"outerConeAngle", 0.5}}}}, turn));
    check_rgb(spot.emitters[0].direction, {-1, 0, 0});
    CHECK(spot.emitters[0].cutoff == Approx(0.5f));
    const Scene point = load(with_light(quad_scene(), {{"type", "point"}, {"intensity", 5}}, turn));
    check_rgb(point.emitters[0].position, {0, 0, 2});
}

TEST_CASE("what is below an invisible node is left out, but for cameras") {
    Json j = quad_scene();
    j["extensionsUsed"] = j["extensionsRequired"] = {"KHR_lights_punctual", "KHR_node_visibility"};
    j["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
    const Json hidden = {{"KHR_node_visibility", {{"visible", false}}}},
               shown = {{"KHR_node_visibility", {{"visible", true}}}};
    j["scenes"][0]["nodes"] = {0, 2};
    j["nodes"][1]["extensions"] = shown;
    j["nodes"][1]["mesh"] = 0;
    j["nodes"].push_back({{"children", {1, 3}}, {"extensions", hidden}});
    j["nodes"].push_back({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    const Scene without = load(j);
    CHECK(without.shapes.size() == 1);
    CHECK(without.environment != kNone);  // since there is no light
    CHECK(without.sensor.to_world.m[2][3] == 3);
    j["nodes"][2]["extensions"] = shown;
    const Scene with = load(j);
    CHECK(with.shapes.size() == 2);
    CHECK(with.emitters.size() == 1);
    CHECK(with.environment == kNone);
}

TEST_CASE("binary files and files beside") {
    const TempFolder folder;
    Json j = quad_scene();
    j["buffers"][0]["uri"] = "quad.bin";
    folder.write("quad.bin", quad_bytes());
    const Scene beside = load(j, {}, &folder);
    CHECK(beside.triangles.size() == 2);
    j["buffers"][0].erase("uri");
    std::string text = j.dump(), data = quad_bytes();
    while (text.size() % 4) text += ' ';
    const auto word = [](uint32_t v) { return std::string(reinterpret_cast<const char*>(&v), 4); };
    const std::string glb = "glTF" + word(2) + word(uint32_t(28 + text.size() + data.size())) +
                            word(uint32_t(text.size())) + "JSON" + text + word(uint32_t(data.size())) +
                            std::string("BIN\0", 4) + data;
    const std::string path = folder.write("scene.glb", glb);
    CHECK(load_scene_file(path).triangles.size() == 2);
    for (size_t n = 0; n < glb.size(); n += 7)
        CHECK_THROWS_AS(load_scene_file(folder.write("cut.glb", glb.substr(0, n))), Error);
}

TEST_CASE("an image that is not there is said not to exist, whatever it is called") {
    for (const std::string name :
         {"textures/Wood.PNG", "http://example.org/a%20b.png", "/no/such/folder/a.png", "file:///no/such/a.png",
          "C:\\textures\\a.png", "..\\textures\\a.png", "a%20b.png"}) {
        Json j = quad_scene();
        j["images"] = {{{"uri", name}}};
        j["textures"] = {{{"source", 0}}};
        CHECK(load(j).triangles.size() == 2);  // nothing uses it
        j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
        INFO(name);
        CHECK(contains(error_of(j), "material 0: the file of image 0, '" + name + "', does not exist"));
    }
    // What is there is found, however it is written.
    const TempFolder folder;
    folder.write("a b.png", png_bytes(1, 1, {255, 255, 255}));
    std::filesystem::create_directories(folder.path / "in");
    folder.write("in/c.png", png_bytes(1, 1, {255, 255, 255}));
    for (const std::string name :
         {std::string("a%20b.png"), std::string("in\\c.png"), std::string("./in/c.png"),
          (folder.path / "in/c.png").string(), "file://" + (folder.path / "in/c.png").string()}) {
        Json j = quad_scene();
        j["images"] = {{{"uri", name}}};
        j["textures"] = {{{"source", 0}}};
        j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
        INFO(name);
        CHECK(load(j, {}, &folder).triangles.size() == 2);
    }
}

TEST_CASE("lights that shine nothing are none") {
    for (const std::string type : {"point", "directional", "spot"}) {
        const Json light = {{"type", type}, {"intensity", 0}, {"spot", Json::object()}};
        const Scene s = load(with_light(quad_scene(), light));
        CHECK(s.environment != kNone);
        CHECK(s.emitters.size() == 1);
        CHECK(has_note(s, "lights of intensity 0 are left out"));
        CHECK(has_note(s, "the file has no light"));
        CHECK(load(with_light(quad_scene(), {{"type", "point"}, {"color", {0, 0, 0}}})).environment != kNone);
    }
    const auto textured = [](const std::vector<uint8_t>& texels) {
        Json j = quad_scene();
        add_image(j, png_bytes(2, 1, texels));
        j["materials"][0]["emissiveFactor"] = {1, 0, 0};
        j["materials"][0]["emissiveTexture"] = {{"index", 0}};
        return load(j);
    };
    CHECK(has_note(textured({0, 0, 0, 0, 0, 0}), "the file has no light"));
    CHECK(has_note(textured({0, 255, 0, 0, 0, 255}), "the file has no light"));
    CHECK(textured({0, 0, 0, 1, 0, 0}).environment == kNone);
    // In scenes of Mitsuba, whose images are black without light, a note says so.
    const std::string point = "<shape type='rectangle'/><emitter type='point'><rgb name='intensity' value='";
    CHECK(has_note(test::load(point + "0'/></emitter>"), "all its lights have zero radiance"));
    CHECK_FALSE(has_note(test::load(point + "0, 1, 0'/></emitter>"), "all its lights have zero radiance"));
}

TEST_CASE("what is not known is refused by name") {
    std::vector<std::pair<std::string, Json>> cases;
    const auto add = [&](const std::string& problem) -> Json& {
        return cases.emplace_back(problem, quad_scene()).second;
    };
    add("extension 'KHR_draco_mesh_compression' is not supported")["extensionsRequired"] = {
        "KHR_draco_mesh_compression"};
    Json& iridescent = add("extension 'KHR_materials_iridescence' is not supported");
    iridescent["materials"][0]["extensions"]["KHR_materials_iridescence"] = {{"iridescenceFactor", 1}};
    iridescent["extensionsUsed"] = iridescent["extensionsRequired"] = {"KHR_materials_iridescence"};
    for (const auto& [problem, j] : cases) {
        INFO(problem);
        CHECK(contains(error_of(j), "scene.gltf: "));
        CHECK(contains(error_of(j), problem));
        LoadOptions lenient;
        lenient.lenient = true;
        CHECK(load(j, lenient).warnings.size() == 1);
    }
}

TEST_CASE("files that lie are refused") {
    const auto changed = [](auto change) {
        Json j = quad_scene();
        change(j);
        return error_of(j);
    };
    CHECK(contains(changed([](Json& j) { j["accessors"][0]["count"] = 5; }), "beyond its buffer"));
    CHECK(contains(changed([](Json& j) { j["accessors"][0]["count"] = 4000000000u; }), "beyond its buffer"));
    CHECK(contains(changed([](Json& j) { j["accessors"][0]["byteOffset"] = 4000000000u; }), "beyond its buffer"));
    CHECK(contains(changed([](Json& j) { j["bufferViews"][0]["byteOffset"] = 4000000000u; }), "beyond the buffer"));
    CHECK(contains(changed([](Json& j) { j["accessors"][0]["type"] = "SCALAR"; }), "wrong type"));
    CHECK(contains(changed([](Json& j) { j["meshes"][0]["primitives"][0]["material"] = 7; }), "no material 7"));
    CHECK(contains(changed([](Json& j) { j["nodes"][0]["mesh"] = 7; }), "no mesh 7"));
    CHECK(contains(changed([](Json& j) { j["nodes"][0]["children"] = {0}; }), "--limits nesting"));
    CHECK(contains(changed([](Json& j) { j["scenes"][0]["nodes"] = {9}; }), "no node 9"));
    CHECK(contains(changed([](Json& j) { j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 3; }),
                   "no texture 3"));
    CHECK(changed([](Json& j) { j["asset"].erase("version"); }) != "no error");
    CHECK(contains(changed([](Json& j) { j["asset"]["minVersion"] = "2.1"; }), "it asks for glTF 2.1"));
    // tinygltf would take the default instead.
    CHECK(contains(changed([](Json& j) { j["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = "0.5"; }),
                   "property 'metallicFactor' of pbrMetallicRoughness is a text, which glTF does not allow there"));
    CHECK(contains(changed([](Json& j) { j["materials"][0]["extensions"]["KHR_materials_ior"]["ior"] = "1.7"; }),
                   "property 'ior' of KHR_materials_ior is a text, which glTF does not allow there"));
    CHECK(contains(changed([](Json& j) { j["materials"][0]["doubleSided"] = "true"; }),
                   "property 'doubleSided' of material is a text"));
    CHECK(contains(changed([](Json& j) { j["materials"][0]["emissiveFactor"] = {"1", "1", "1"}; }),
                   "property 'emissiveFactor' of material is a text, which glTF does not allow there"));
    // tinygltf would leave out the whole material.
    CHECK(contains(changed([](Json& j) { j["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1}; }),
                   "baseColorFactor"));
    CHECK(contains(
        changed([](Json& j) { j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = Json::object(); }),
        "'index' property is missing"));
    // Images inside of buffers.
    for (const auto& [key, value, problem] :
         std::vector<std::tuple<std::string, Json, std::string>>{{"byteOffset", 4000000000u, "beyond the buffer"},
                                                                 {"byteLength", 4000000000u, "beyond the buffer"},
                                                                 {"buffer", 7, "buffer"}}) {
        const std::string error = changed([&](Json& j) {
            j["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 48}});
            j["bufferViews"].back()[key] = value;
            j["images"] = {{{"bufferView", j["bufferViews"].size() - 1}, {"mimeType", "image/png"}}};
            j["textures"] = {{{"source", 0}}};
            j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
        });
        INFO(error);
        CHECK(contains(error, problem));
    }
    // Whatever a file is cut off at.
    const TempFolder folder;
    const std::string text = quad_scene().dump();
    for (size_t n = 0; n < text.size(); n += 13)
        CHECK_THROWS_AS(load_gltf(folder.write("cut.gltf", text.substr(0, n))), Error);
}

TEST_CASE("the same scene in Mitsuba's XML has the same image") {
    const TempFolder folder;
    Json j = with_light(quad_scene(), {{"type", "point"}, {"intensity", 20}}, {{"translation", {1, 1, 2}}});
    LoadOptions size;
    size.width = 36, size.height = 24;
    const Scene a = load(j, size);
    const Scene b = load_mitsuba(
        folder.write("scene.xml",
                     R"(<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='51.56620156177409'/>
<string name='fov_axis' value='y'/><float name='near_clip' value='0.01'/><transform name='to_world'>
<lookat origin='0,0,3' target='0,0,0' up='0,1,0'/></transform>
<film type='hdrfilm'/></sensor><emitter type='point'><point name='position' x='1' y='1' z='2'/>
<rgb name='intensity' value='20'/></emitter>
<shape type='rectangle'><bsdf type='twosided'><bsdf type='principled'><rgb name='base_color' value='.5 .6 .7'/>
<float name='roughness' value='.5'/>
<float name='metallic' value='.25'/><float name='eta' value='1.5'/></bsdf></bsdf></shape></scene>)"),
        size);
    const auto film = [](const Scene& s) { return render_scene(s, cpu_settings(s, Estimator::mis), 16).film; };
    const FilmMoments x = film(a), y = film(b);
    double difference = 0, sum = 0;
    for (size_t i = 0; i < x.sum.size(); ++i) difference += std::abs(x.mean(i) - y.mean(i)), sum += x.mean(i);
    CHECK(sum > 0);
    CHECK(difference < 1e-4 * sum);
    write_mitsuba(a, folder / "converted.xml");
    CHECK(load_mitsuba(folder / "converted.xml").features == a.features);
}
