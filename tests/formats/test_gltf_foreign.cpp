// libs: ambilux_formats
// timeout: 60
// What glTF files of others have: materials of older programs, normal maps in a mirror, things that are not quite
// right.
#include "formats/images/image_write.h"
#include "tests/support/gltf_text.h"
#include "tests/support/mitsuba_text.h"
#include "transport/scattering.h"

using namespace ambilux;
using namespace ambilux::test::gltf;
using test::check_rgb;
using test::contains;
using test::has_note;

namespace {

Json& material(Json& j) { return j["materials"][0]; }

void add_texture(Json& j, const std::string& png) {
    j["images"].push_back({{"uri", data_uri("image/png", png)}});
    j["textures"].push_back({{"source", j["images"].size() - 1}});
}

const auto& principled(const Scene& s) { return s.bsdfs[s.materials[s.shapes[0].material].front].as<Principled>(); }

/// Normal that the map of the first triangle makes, where it lies in the world.
Vec3f mapped_normal(const Scene& s) {
    const SceneView view = s.view();
    const Triangle& t = s.triangles[0];
    const SurfacePoint point = detail::triangle_point(s.vertices[t.v0], s.vertices[t.v1], s.vertices[t.v2],
                                                      s.shapes[t.shape].flags, 0.3f, 0.3f);
    return perturbed_normal<kAllFeatures>(view, s.bsdfs[s.materials[s.shapes[0].material].front], point);
}

/// The quad with a map whose texels lean to the right and up in the image.
Json leaning() {
    Json j = quad_scene();
    add_texture(j, png_bytes(1, 1, {217, 179, 236}));
    material(j)["normalTexture"] = {{"index", 0}};
    return j;
}

}  // namespace

TEST_CASE("normal maps lean as their image does, also in a mirror, turned, and at nodes that mirror") {
    const Vec3f n = mapped_normal(load(leaning()));
    CHECK(n.x == Approx(0.598).margin(0.005));
    CHECK(n.y == Approx(0.344).margin(0.005));

    // Texture coordinates that show the image in a mirror: its right is left, its up is up.
    Json mirrored = leaning();
    attributes(mirrored)["TEXCOORD_0"] = add_accessor<float>(mirrored, {1, 1, 0, 1, 0, 0, 1, 0}, "VEC2", kFloat, 4);
    const Vec3f m = mapped_normal(load(mirrored));
    CHECK(m.x == Approx(-n.x).margin(0.005));
    CHECK(m.y == Approx(n.y).margin(0.005));

    // Upside down.
    Json down = leaning();
    attributes(down)["TEXCOORD_0"] = add_accessor<float>(down, {0, 0, 1, 0, 1, 1, 0, 1}, "VEC2", kFloat, 4);
    const Vec3f d = mapped_normal(load(down));
    CHECK(d.x == Approx(n.x).margin(0.005));
    CHECK(d.y == Approx(-n.y).margin(0.005));

    Json node = leaning();
    node["nodes"][0]["scale"] = {-1, 1, 1};
    const Vec3f k = mapped_normal(load(node));
    CHECK(k.x == Approx(-n.x).margin(0.005));
    CHECK(k.y == Approx(n.y).margin(0.005));
    CHECK(k.z == Approx(n.z).margin(0.005));

    // Turned by KHR_texture_transform so that the image's right is down, unless the file gives tangents.
    Json turned = leaning();
    turned["extensionsUsed"] = {"KHR_texture_transform"};
    material(turned)["normalTexture"]["extensions"]["KHR_texture_transform"] = {{"rotation", M_PI / 2}};
    const Vec3f t = mapped_normal(load(turned));
    // u' = v and v' = -u: the image's right is where v grows, down; its up is where u grows, right.
    CHECK(t.x == Approx(n.y).margin(0.005));
    CHECK(t.y == Approx(-n.x).margin(0.005));
    attributes(turned)["TANGENT"] =
        add_accessor<float>(turned, {1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}, "VEC4", kFloat, 4);
    CHECK(mapped_normal(load(turned)).x == Approx(n.x).margin(0.005));
}

TEST_CASE("a mesh that shows its map in a mirror on one half is two, of two nodes two each where one mirrors") {
    Json j = leaning();
    attributes(j)["TEXCOORD_0"] =
        add_accessor<float>(j, {0, 1, 1, 1, 1, 0, 2, 1}, "VEC2", kFloat, 4);  // the second triangle's u is turned
    CHECK(load(j).shapes.size() == 2);
    CHECK(load(j).triangles.size() == 2);
    j["nodes"].push_back({{"mesh", 0}, {"scale", {-1, 1, 1}}, {"translation", {5, 0, 0}}});
    j["scenes"][0]["nodes"].push_back(2);
    const Scene s = load(j);
    CHECK(s.triangles.size() == 4);
    CHECK(s.bsdfs.size() == 2);
}

TEST_CASE("joints that mirror keep the outside of a mesh") {
    Json j = quad_scene();
    const uint8_t first[16] = {};
    const std::string bytes(reinterpret_cast<const char*>(first), sizeof first);
    j["buffers"].push_back({{"byteLength", 16}, {"uri", data_uri("application/octet-stream", bytes)}});
    j["bufferViews"].push_back({{"buffer", j["buffers"].size() - 1}, {"byteLength", 16}});
    j["accessors"].push_back(
        {{"bufferView", j["bufferViews"].size() - 1}, {"componentType", 5121}, {"count", 4}, {"type", "VEC4"}});
    attributes(j)["JOINTS_0"] = j["accessors"].size() - 1;
    attributes(j)["WEIGHTS_0"] =
        add_accessor<float>(j, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", kFloat, 4);
    j["skins"] = {{{"joints", {2}}}};
    j["nodes"].push_back({{"scale", {-1, 1, 1}}});
    j["scenes"][0]["nodes"].push_back(2);
    j["nodes"][0]["skin"] = 0;
    const Scene s = load(j);
    check_rgb(s.vertices[0].p, {1, -1, 0});
    check_rgb(s.vertices[0].n, {0, 0, 1});
    const Triangle& t = s.triangles[0];
    CHECK(cross(s.vertices[t.v1].p - s.vertices[t.v0].p, s.vertices[t.v2].p - s.vertices[t.v0].p).z > 0);
}

TEST_CASE("specular-glossiness is converted") {
    Json j = quad_scene();
    j["extensionsUsed"] = j["extensionsRequired"] = {"KHR_materials_pbrSpecularGlossiness"};
    Json& given = material(j)["extensions"]["KHR_materials_pbrSpecularGlossiness"];
    given = {
        {"diffuseFactor", {0.48, 0.24, 0.12, 1}}, {"specularFactor", {0.04, 0.04, 0.04}}, {"glossinessFactor", 0.7}};
    const Scene plastic = load(j);
    CHECK(has_note(plastic, "converted to metallic-roughness"));
    check_rgb(principled(plastic).base_color.value, {0.48f, 0.24f, 0.12f}, 1e-3);
    CHECK(principled(plastic).metallic.value == Approx(0).margin(1e-3));
    CHECK(principled(plastic).roughness.value == Approx(0.3));

    given["diffuseFactor"] = {0, 0, 0, 1};
    given["specularFactor"] = {1.0, 0.7, 0.3};
    const Scene gold = load(j);
    CHECK(principled(gold).metallic.value == Approx(1).margin(1e-3));
    check_rgb(principled(gold).base_color.value, {1.0f, 0.7f, 0.3f}, 1e-3);

    // With textures, texel by texel: the left one is gold and smooth, the right one rough and blue.
    add_texture(j, png_bytes(2, 1, {0, 0, 0, 0, 0, 188}));
    add_texture(j, png_bytes(1, 1, {255, 255, 255}));
    given["specularFactor"] = {0.04, 0.04, 0.04};
    given["diffuseFactor"] = {1, 1, 1, 1};
    given["diffuseTexture"] = {{"index", 0}};
    const Scene textured = load(j);
    const auto& p = principled(textured);
    check_rgb(eval_rgb<kAllFeatures>(textured.view(), p.base_color, {0.75f, 0.5f}), {0, 0, 0.503f}, 5e-3);
    CHECK(eval_float<kAllFeatures>(textured.view(), p.roughness, {0.75f, 0.5f}) == Approx(0.3).margin(0.003));
    CHECK(eval_float<kAllFeatures>(textured.view(), p.metallic, {0.75f, 0.5f}) == Approx(0).margin(0.003));
    given["specularGlossinessTexture"] = {{"index", 1}, {"texCoord", 1}};
    CHECK(contains(error_of(j), "several sets of texture coordinates"));
}

TEST_CASE("anisotropy, light that passes and attenuation as the principled BSDF and glass have them") {
    Json j = quad_scene();
    j["extensionsUsed"] = {"KHR_materials_anisotropy"};
    material(j)["extensions"]["KHR_materials_anisotropy"] = {{"anisotropyStrength", 0.5}};
    const Scene s = load(j);
    // Roughness 0.5: 0.25 across, mix(0.25, 1, 0.25) = 0.4375 along.
    const auto& p = principled(s);
    const double aspect = std::sqrt(1 - 0.9 * p.anisotropic.value), r2 = p.roughness.value * p.roughness.value;
    CHECK(r2 / aspect == Approx(0.4375).epsilon(1e-4));
    CHECK(r2 * aspect == Approx(0.25).epsilon(1e-4));

    Json leaf = quad_scene();
    leaf["extensionsUsed"] = {"KHR_materials_diffuse_transmission"};
    material(leaf)["extensions"]["KHR_materials_diffuse_transmission"] = {
        {"diffuseTransmissionFactor", 0.25}, {"diffuseTransmissionColorFactor", {0.5, 0.6, 0.1}}};
    const Scene l = load(leaf);
    REQUIRE(l.bsdfs.size() >= 2);
    const auto through = std::find_if(l.bsdfs.begin(), l.bsdfs.end(),
                                      [](const BsdfRecord& r) { return r.type == BsdfType::diffuse_transmitter; });
    REQUIRE(through != l.bsdfs.end());
    check_rgb(through->as<DiffuseTransmitter>().transmittance.value, {0.5f, 0.6f, 0.1f});

    Json glass = quad_scene();
    glass["extensionsUsed"] = {"KHR_materials_transmission", "KHR_materials_volume"};
    material(glass)["pbrMetallicRoughness"] = {{"metallicFactor", 0}, {"roughnessFactor", 0}};
    material(glass)["extensions"] = {
        {"KHR_materials_transmission", {{"transmissionFactor", 1}}},
        {"KHR_materials_volume",
         {{"thicknessFactor", 2}, {"attenuationDistance", 1}, {"attenuationColor", {1, 0.5, 0.25}}}}};
    const Scene g = load(glass);
    CHECK(has_note(g, "attenuation in a volume uses the thickness"));
    check_rgb(g.bsdfs[g.materials[g.shapes[0].material].front].as<Dielectric>().specular_transmittance.value,
              {1, 0.5f, 0.25f}, 1e-5);
}

TEST_CASE("mapped normals that face away are turned, and what lies flat is seen from above") {
    const Scene mapped = load(leaning());
    CHECK(mapped.bsdfs[mapped.materials[mapped.shapes[0].material].front].map_rules == kTurnNormals);

    Json flat = quad_scene();
    flat["scenes"][0]["nodes"] = {0};
    CHECK(has_note(load(flat), "looks along -z"));
    flat["nodes"][0]["rotation"] = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
    const Scene s = load(flat);
    CHECK(has_note(s, "looks down at all of it by 45 degrees"));
    const Vec3f forward = s.sensor.to_world.vector({0, 0, 1});
    CHECK(forward.y == Approx(forward.z));
    CHECK(forward.y < 0);
}

TEST_CASE("what is not quite right is left out or read as it is meant") {
    Json hidden = quad_scene();
    hidden["nodes"].push_back({{"mesh", 0}, {"scale", {0, 0, 0}}});
    hidden["nodes"].push_back({{"mesh", 0}, {"rotation", {0, 0, 0, 0}}, {"translation", {3, 0, 0}}});
    hidden["scenes"][0]["nodes"] = {0, 1, 2, 3};
    const Scene s = load(hidden);
    CHECK(has_note(s, "meshes that are scaled to nothing are left out"));
    CHECK(s.triangles.size() == 4);
    hidden["scenes"][0]["nodes"] = {2};
    CHECK(contains(error_of(hidden), "it shows no triangles"));

    Json bare = quad_scene();
    bare["meshes"][0]["primitives"].push_back({{"attributes", {{"NORMAL", 1}}}});
    CHECK(has_note(load(bare), "primitives without positions are left out"));

    Json wide = quad_scene();
    wide["extensionsUsed"] = {"KHR_lights_punctual"};
    wide["extensions"]["KHR_lights_punctual"]["lights"] = {
        {{"type", "spot"}, {"spot", {{"outerConeAngle", M_PI / 2}}}}};
    wide["nodes"][0]["extensions"]["KHR_lights_punctual"] = {{"light", 0}};
    CHECK(has_note(load(wide), "a tenth of a degree narrower"));

    Json long_error = quad_scene();
    long_error["buffers"][0]["uri"] = data_uri("application/unknown", std::string(10000, 'x'));
    CHECK(error_of(long_error).size() < 600);
}

TEST_CASE("sets of texture coordinates: two of one content, none, and one that a target moves") {
    Json j = quad_scene();
    add_texture(j, png_bytes(2, 1, {255, 0, 0, 0, 0, 255}));
    attributes(j)["TEXCOORD_1"] = add_accessor<float>(j, {0, 1, 1, 1, 1, 0, 0, 0}, "VEC2", kFloat, 4);
    material(j)["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}},
                                           {"metallicRoughnessTexture", {{"index", 0}, {"texCoord", 1}}}};
    CHECK(load(j).triangles.size() == 2);
    Json other = j;
    attributes(other)["TEXCOORD_1"] = add_accessor<float>(other, {0, 1, 1, 1, 1, 0, 0, 0.5f}, "VEC2", kFloat, 4);
    CHECK(contains(error_of(other), "several sets of texture coordinates"));

    Json none = j;
    material(none)["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}}};
    attributes(none).erase("TEXCOORD_0");
    const Scene s = load(none);
    CHECK(has_note(s, "textures have one colour on a mesh without texture coordinates"));
    CHECK(s.vertices[2].uv().x == 0);

    Json moved = quad_scene();
    moved["meshes"][0]["primitives"][0]["targets"] = {
        {{"TEXCOORD_0", add_accessor<float>(moved, {1, 0, 1, 0, 1, 0, 1, 0}, "VEC2", kFloat, 4)}}};
    moved["meshes"][0]["weights"] = {0.5};
    CHECK(load(moved).vertices[0].uv().x == Approx(0.5));
}
