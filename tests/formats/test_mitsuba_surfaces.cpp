// libs: ambilux_convert ambilux_formats ambilux_accel
// timeout: 120
// BSDFs that are made of others, those of the older generation, and textures from meshes.
#include <cmath>

#include "core/math.h"
#include "formats/convert/convert.h"
#include "scene/surface.h"
#include "tests/support/mitsuba_text.h"
#include "transport/blend.h"
#include "transport/bsdf/coating.h"
#include "transport/bsdf/precompute.h"
#include "transport/resolve_bsdf.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("phong, ward and difftrans with their defaults") {
    const auto record = [](const std::string& xml) {
        const Scene s = load_quietly("<shape type='rectangle'>" + xml + "</shape>", "0.6.0");
        return s.bsdfs[s.materials[s.shapes[0].material].front];
    };
    const auto phong = record("<bsdf type='phong'/>").as<Phong>();
    check_rgb(phong.reflectance.value, splat(0.5f));
    check_rgb(phong.specular_reflectance.value, splat(0.2f));
    CHECK(phong.exponent.value == 30);
    CHECK(phong.specular_sampling_weight == Approx(0.2 / 0.7));
    const auto ward = record("<bsdf type='ward'><float name='alphaU' value='0.2'/></bsdf>").as<Ward>();
    CHECK(ward.variant == WardVariant::balanced);
    CHECK(ward.alpha_u.value == 0.2f);
    CHECK(ward.alpha_v.value == 0.1f);
    check_rgb(record("<bsdf type='difftrans'/>").as<DiffuseTransmitter>().transmittance.value, splat(0.5f));
    const Scene bright = load_quietly(
        "<shape type='rectangle'><bsdf type='phong'><rgb name='diffuse_reflectance' "
        "value='0.9'/><rgb name='specular_reflectance' value='0.3'/></bsdf></shape>");
    CHECK(has_note(bright, "sum to more than 1"));
    const auto scaled = bright.bsdfs[bright.materials[bright.shapes[0].material].front].as<Phong>();
    CHECK(scaled.reflectance.value.x + scaled.specular_reflectance.value.x == Approx(0.99));
}

TEST_CASE("microfacets of phong: read, named, written and read again") {
    for (const std::string name : {"phong", "as"}) {
        const std::string facets = "<string name='distribution' value='" + name + "'/>";
        const Scene s = load("<shape type='rectangle'><bsdf type='roughconductor'>" + facets +
                                 "<float name='alphaU' value='0.2'/><float name='alphaV' value='0.4'/></bsdf></shape>"
                                 "<shape type='rectangle'><bsdf type='roughdielectric'>" +
                                 facets + "</bsdf></shape><shape type='rectangle'><bsdf type='roughplastic'>" + facets +
                                 "<float name='alpha' value='0.3'/></bsdf></shape>",
                             {}, "0.6.0");
        CHECK(s.features.phong_facets);
        const auto check_all = [](const Scene& scene) {
            const auto record = [&](size_t shape) {
                return scene.bsdfs[scene.materials[scene.shapes[shape].material].front];
            };
            const auto metal = parameters<RoughConductor>(record(0));
            CHECK(metal.distribution == Microfacets::phong);
            CHECK(!metal.sample_visible);
            CHECK(metal.alpha_u.value == 0.2f);
            CHECK(metal.alpha_v.value == 0.4f);
            CHECK(parameters<RoughDielectric>(record(1)).distribution == Microfacets::phong);
            const auto plastic = parameters<RoughPlastic>(record(2));
            CHECK(plastic.distribution == Microfacets::phong);
            CHECK(!plastic.sample_visible);
            CHECK(plastic.fdr_internal == rough_internal_reflectance(Microfacets::phong, 0.3f, plastic.ior));
        };
        check_all(s);
        const TempFolder folder;
        const std::vector<std::string> notes = write_mitsuba(s, folder / "out.xml");
        CHECK(std::count(notes.begin(), notes.end(), "Mitsuba 3 has no microfacet distribution 'phong'") == 1);
        check_all(load_mitsuba(folder / "out.xml"));
    }
    const std::string coat =
        "<shape type='rectangle'><bsdf type='roughcoating'><string name='distribution' value='phong'/><bsdf "
        "type='diffuse'/></bsdf></shape>";
    CHECK(contains(error_of(coat), "microfacets of phong in a roughcoating are not supported"));
    CHECK(!load_quietly("<shape type='rectangle'><bsdf type='roughconductor'/></shape>").features.phong_facets);
}

TEST_CASE("blends: what they are made of, with weights; null makes a mask of it") {
    const std::string red = "<bsdf type='diffuse'><rgb name='reflectance' value='1,0,0'/></bsdf>",
                      blue = "<bsdf type='diffuse'><rgb name='reflectance' value='0,0,1'/></bsdf>",
                      weight = "<float name='weight' value='0.25'/>";
    const auto load_blend = [&](const std::string& xml) {
        return load_quietly("<shape type='rectangle'>" + xml + "</shape>");
    };
    const auto material_of_shape = [](const Scene& s) { return s.materials[s.shapes[0].material]; };
    const auto color = [](const Scene& s, uint32_t material) {
        return s.bsdfs[s.materials[material].front].as<Diffuse>().reflectance.value;
    };
    const Scene s = load_blend("<bsdf type='blendbsdf'>" + weight + red + blue + "</bsdf>");
    CHECK(s.features.blends);
    CHECK(material_of_shape(s).second_weight.value == 0.25f);
    check_rgb(color(s, material_of_shape(s).first), {1, 0, 0});
    check_rgb(color(s, material_of_shape(s).second), {0, 0, 1});
    CHECK(!load_blend(red).features.blends);

    // Two sides, a mask and a bump go around it.
    const Scene sides = load_blend(
        "<bsdf type='mask'><float name='opacity' value='0.5'/><bsdf type='twosided'><bsdf "
        "type='blendbsdf'>" +
        weight + red + blue + "</bsdf></bsdf></bsdf>");
    CHECK(material_of_shape(sides).opacity.value == 0.5f);
    CHECK(sides.materials[material_of_shape(sides).first].two_sided == 1);
    CHECK(sides.materials[material_of_shape(sides).second].opacity.value == 1);

    // 0.2, 0.3, and 0.5 that are missing.
    const Scene mixture =
        load_blend("<bsdf type='mixturebsdf'><string name='weights' value='0.2, 0.3'/>" + red + blue + "</bsdf>");
    const Material& m = material_of_shape(mixture);
    check_rgb(color(mixture, m.first), {1, 0, 0});
    CHECK(m.second_weight.value == Approx(0.8));
    const Material& rest = mixture.materials[m.second];
    check_rgb(color(mixture, rest.first), {0, 0, 1});
    check_rgb(color(mixture, rest.second), {0, 0, 0});
    CHECK(rest.second_weight.value == Approx(0.625));

    const Scene glass = load_blend("<bsdf type='blendbsdf'>" + weight + red + "<bsdf type='dielectric'/></bsdf>");
    CHECK(glass.bsdfs[material_of_shape(glass).front].type == BsdfType::dielectric);
    const Scene mask = load_blend("<bsdf type='blendbsdf'>" + weight + "<bsdf type='null'/>" + red + "</bsdf>");
    CHECK(!mask.features.blends);
    CHECK(material_of_shape(mask).opacity.value == 0.25f);
    const auto refused = [&](const std::string& xml) {
        return error_of("<shape type='rectangle'>" + xml + "</shape>");
    };
    CHECK(contains(refused("<bsdf type='blendbsdf'>" + red + "</bsdf>"), "blendbsdf needs two nested BSDFs"));
    CHECK(contains(refused("<bsdf type='mixturebsdf'><string name='weights' value='0.2'/>" + red + blue + "</bsdf>"),
                   "mixturebsdf has 2 BSDFs and 1 weights"));
    CHECK(
        contains(refused("<bsdf type='mixturebsdf'><string name='weights' value='0.6,0.6'/>" + red + blue + "</bsdf>"),
                 "sum to 1 at most"));
}

TEST_CASE("principled: parameters, and transmission as a blend with rough glass") {
    const auto load_principled = [](const std::string& xml) {
        return load_quietly("<shape type='rectangle'><bsdf type='principled'>" + xml + "</bsdf></shape>");
    };
    const auto number = [](const char* name, const char* value) {
        return "<float name='" + std::string(name) + "' value='" + value + "'/>";
    };
    const auto opaque = [](const Scene& s, uint32_t material) {
        return s.bsdfs[s.materials[material].front].as<Principled>();
    };
    const Scene plain = load_principled("");
    const auto p = opaque(plain, plain.shapes[0].material);
    CHECK(p.ior == 1.5f);
    CHECK(p.roughness.value == 0.5f);
    CHECK(p.clearcoat_alpha == 0.1f);
    // 8 % times the share of 0.5 is the reflectance of 1.5.
    const Scene half = load_principled(number("specular", "0.5"));
    CHECK(opaque(half, half.shapes[0].material).ior == Approx(1.5));

    const Scene s = load_principled(number("metallic", "0.25") + number("spec_trans", "0.4") +
                                    number("clearcoat", "0.5") + number("sheen", "0.3") + number("roughness", "0.6") +
                                    "<rgb name='base_color' value='0.25,0.49,1'/>");
    const Material& m = s.materials[s.shapes[0].material];
    CHECK(m.second_weight.value == Approx(0.3));
    const auto rest = opaque(s, m.first);
    CHECK(rest.metallic.value == Approx(0.25 / 0.7));
    CHECK(rest.clearcoat == Approx(0.5 / 0.7));
    CHECK(rest.sheen == Approx(0.3 / 0.6));
    const auto glass = s.bsdfs[s.materials[m.second].front].as<RoughDielectric>();
    check_rgb(glass.specular_transmittance.value, {0.5f, 0.7f, 1});
    CHECK(glass.alpha_u.value == Approx(0.36));
    CHECK(contains(
        error_of("<shape type='rectangle'><bsdf type='principled'>" + number("roughness", "2") + "</bsdf></shape>"),
        "'roughness' must lie between 0 and 1"));
    CHECK(contains(error_of("<shape type='rectangle'><bsdf type='twosided'><bsdf type='principled'>" +
                            number("spec_trans", "0.5") + "</bsdf></bsdf></shape>"),
                   "transmits light cannot be inside of twosided"));
}

TEST_CASE("points of a blend are of its parts by their weights, always the same ones") {
    const Scene s = load_quietly(
        "<shape type='rectangle'><bsdf type='blendbsdf'><float name='weight' value='0.3'/>"
        "<bsdf type='diffuse'/><bsdf type='conductor'/></bsdf></shape>");
    const SceneView view = s.view();
    constexpr int kPoints = 40000;
    int second = 0;
    for (int i = 0; i < kPoints; ++i) {
        // Neighbouring floats, so that the hash has little to work with.
        SurfacePoint point{};
        point.p = {1.0f + float(i % 200) * 0x1p-23f, 2.0f + float(i / 200) * 0x1p-22f, 0.0f};
        const Material& m = material_at<kAllFeatures>(view, point);
        CHECK(&m == &material_at<kAllFeatures>(view, point));
        second += s.bsdfs[m.front].type == BsdfType::conductor;
    }
    const double expected = 0.3 * kPoints, deviation = std::sqrt(0.3 * 0.7 * kPoints);
    CHECK(std::fabs(second - expected) < 4 * deviation);
}

TEST_CASE("mesh attributes are linear between vertices, constant on faces") {
    const TempFolder folder;
    folder.write("m.ply",
                 "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                 "property float r\nproperty float g\nproperty float b\nproperty float w_0\nelement face 2\n"
                 "property list uchar int vertex_indices\nproperty float tone_0\nproperty float tone_1\n"
                 "property float tone_2\nend_header\n"
                 "0 0 0 1 0 0 0.2\n1 0 0 0 1 0 0.4\n1 1 0 0 0 1 0.6\n0 1 0 1 1 0 0.8\n"
                 "3 0 1 2 0.1 0.2 0.3\n3 0 2 3 0.4 0.5 0.6\n");
    const auto shape = [&](const std::string& name) {
        return load_quietly(
            "<shape type='ply'><string name='filename' value='m.ply'/><bsdf type='diffuse'><texture "
            "name='reflectance' type='mesh_attribute'><string name='name' value='" +
                name + "'/></texture></bsdf></shape>",
            "3.0.0", &folder);
    };
    const auto at = [](const Scene& s, uint32_t prim, float u, float v) {
        const SurfacePoint point = surface_at<kAllFeatures>(s.view(), prim, u, v);
        return reflectance(s, 0, point.uv);
    };
    const Scene color = shape("vertex_color"), weight = shape("vertex_w"), tone = shape("face_tone");
    check_rgb(at(color, 0, 0.25f, 0.5f), {0.25f, 0.25f, 0.5f}, 1e-4);
    check_rgb(at(color, 1, 0.125f, 0.5f), {0.875f, 0.5f, 0.125f}, 1e-4);
    check_rgb(at(weight, 1, 0.5f, 0.25f), splat(0.25f * 0.2f + 0.5f * 0.6f + 0.25f * 0.8f), 1e-5);
    check_rgb(at(tone, 0, 0.3f, 0.3f), {0.1f, 0.2f, 0.3f});
    check_rgb(at(tone, 1, 0.3f, 0.3f), {0.4f, 0.5f, 0.6f});
    // Nowhere negative, on edges neither.
    for (int i = 0; i <= 1000; ++i) {
        const float u = float(i) / 1000;
        for (uint32_t prim : {0u, 1u})
            for (const Vec2f& b : {Vec2f{u, 0}, {0, u}, {u, 1 - u}})
                CHECK(min_component(at(color, prim, b.x, b.y)) >= 0);
    }
    const auto refused = [&](const std::string& xml) { return error_of(xml, {}, "3.0.0", &folder); };
    CHECK(contains(refused("<shape type='ply'><string name='filename' value='m.ply'/><bsdf type='diffuse'>\n<texture "
                           "name='reflectance' type='mesh_attribute'><string name='name' value='vertex_x'/></texture>"
                           "</bsdf></shape>"),
                   ":3: the shape has no attribute 'vertex_x'"));
    CHECK(contains(refused("<shape type='cube'><bsdf type='diffuse'><texture name='reflectance' "
                           "type='mesh_attribute'/></bsdf></shape>"),
                   "mesh attributes are read from ply and obj files only"));
}

TEST_CASE("roughness of 0 is taken, as in Mitsuba; what is negative is not") {
    const auto rough = [](const std::string& type, const char* alpha) {
        return "<shape type='rectangle'><bsdf type='" + type + "'><float name='alpha' value='" + alpha +
               "'/></bsdf></shape>";
    };
    for (const char* type : {"roughconductor", "roughdielectric", "roughplastic"}) {
        load_quietly(rough(type, "0"));
        CHECK(contains(error_of(rough(type, "-0.1")), "roughness must not be negative"));
    }
}

TEST_CASE("coatings lie over the BSDF inside, blends and two sides included") {
    const auto materials = [](const std::string& xml) {
        return load_quietly("<shape type='rectangle'>" + xml + "</shape>", "0.6.0");
    };
    const std::string layer = "<float name='thickness' value='2'/><rgb name='sigmaA' value='0.1 0.2 0.3'/>",
                      base = "<bsdf type='diffuse'/>";
    const Scene smooth = materials("<bsdf type='coating'>" + layer + base + "</bsdf>");
    REQUIRE(smooth.features.coats);
    const Coat coat{smooth.tables.data() + smooth.bsdfs[smooth.materials[smooth.shapes[0].material].front].coat};
    CHECK(coat.ior() == Approx(1.5046 / 1.000277));
    CHECK_FALSE(coat.rough());
    CHECK(coat.absorption().y == Approx(0.4));
    CHECK(coat.reflectance() == splat(1));
    const Scene rough = materials("<bsdf type='twosided'><bsdf type='roughcoating'>" + layer +
                                  "<float name='alpha' value='0.3'/><bsdf type='blendbsdf'>" + base +
                                  "<bsdf type='ward'/></bsdf></bsdf></bsdf>");
    for (const BsdfRecord& b : rough.bsdfs) {
        REQUIRE(b.coat != kNone);
        CHECK(Coat{rough.tables.data() + b.coat}.alpha() == 0.3f);
    }
    CHECK(rough.features.blends);
    const auto error = [](const std::string& type, const std::string& inner) {
        return error_of("<shape type='rectangle'><bsdf type='" + type + "'>" + inner + "</bsdf></shape>", {}, "0.6.0");
    };
    CHECK(contains(error("coating", "<bsdf type='dielectric'/>"), "transmits light"));
    CHECK(contains(error("roughcoating", "<bsdf type='conductor'/>"), "deltas alone"));
    CHECK(contains(error("coating", "<bsdf type='coating'>" + base + "</bsdf>"), "coating inside of a coating"));
    CHECK(contains(error("coating", "<bsdf type='bumpmap'><texture type='checkerboard'/>" + base + "</bsdf>"),
                   "put the coating inside of the bumpmap"));
    CHECK(contains(error("coating", "<float name='intIOR' value='1.000277'/>" + base), "must differ"));
    CHECK(contains(error("coating", ""), "no nested BSDF"));
}

TEST_CASE("projector: fields of view by the texture's shape") {
    const std::string at = "<transform name='to_world'><lookat origin='0,0,3' target='0,0,0' up='0,1,0'/></transform>";
    const Scene s = load_quietly("<emitter type='projector'>" + at +
                                 "<float name='fov' value='90'/><rgb name='irradiance' value='2'/><float name='scale' "
                                 "value='3'/></emitter>");
    const Emitter& e = s.emitters[0];
    CHECK(e.type == EmitterType::projector);
    CHECK(e.cutoff == Approx(1));
    CHECK(e.beam_width == Approx(1));
    CHECK(e.radiance.value.x == Approx(6 * M_PI));
    CHECK(e.position.z == 3);
    CHECK(s.features.emitters == bit(EmitterType::projector));
}

TEST_CASE("principledthin: parameters, and what is refused") {
    const auto load_thin = [](const std::string& xml) {
        const Scene s = load_quietly("<shape type='rectangle'><bsdf type='principledthin'>" + xml + "</bsdf></shape>");
        return parameters<PrincipledThin>(s.bsdfs[s.materials[s.shapes[0].material].front]);
    };
    const auto number = [](const char* name, const char* value) {
        return "<float name='" + std::string(name) + "' value='" + value + "'/>";
    };
    const auto plain = load_thin("");
    CHECK(plain.ior == 1.5f);
    CHECK(plain.roughness.value == 0.5f);
    CHECK(plain.specular.value == 0);
    CHECK(plain.through == 0);
    const auto p =
        load_thin(number("spec_trans", "0.4") + number("diff_trans", "1.5") + number("eta", "1.3") +
                  number("anisotropic", "0.5") + number("spec_tint", "0.3") + number("sheen", "0.2") +
                  number("sheen_tint", "0.6") + number("flatness", "0.1") +
                  number("specular_reflectance_sampling_rate", "2") + "<rgb name='base_color' value='0.1,0.2,0.3'/>");
    CHECK(p.specular.value == 0.4f);
    CHECK(p.through == 0.75f);
    CHECK(p.ior == 1.3f);
    CHECK(p.anisotropic.value == 0.5f);
    CHECK(p.specular_tint == 0.3f);
    CHECK(p.sheen == 0.2f);
    CHECK(p.sheen_tint == 39321);
    CHECK(p.flatness == 6554);
    check_rgb(p.base_color.value, {0.1f, 0.2f, 0.3f});
    const auto error = [](const std::string& xml) {
        return error_of("<shape type='rectangle'><bsdf type='principledthin'>" + xml + "</bsdf></shape>");
    };
    CHECK(contains(error(number("diff_trans", "2.5")), "'diff_trans' must lie between 0 and 2"));
    CHECK(contains(error(number("eta", "0.9")), "'eta' of principledthin must not be less than 1"));
    CHECK(contains(error(number("sheen", "-0.1")), "'sheen' must not be negative"));
    CHECK(load_thin(number("sheen", "1.5")).sheen == 1.5f);
    CHECK(contains(error(number("metallic", "1")), "unknown parameter 'metallic' of bsdf 'principledthin'"));
    CHECK(
        contains(error_of("<shape type='rectangle'><bsdf type='twosided'><bsdf type='principledthin'/></bsdf></shape>"),
                 "transmits light cannot be inside of twosided"));
}

namespace {

struct Slot {
    const char* name;
    float lower = 0, upper = 1;
};
const std::vector<Slot> kSlotsOfBoth = {{"roughness"}, {"anisotropic"}, {"spec_tint"},
                                        {"sheen"},     {"sheen_tint"},  {"flatness"}};
std::vector<Slot> slots_of(const std::string& plugin) {
    std::vector<Slot> slots = kSlotsOfBoth;
    const std::vector<Slot> own = plugin == "principled"
                                      ? std::vector<Slot>{{"metallic"}, {"clearcoat"}, {"clearcoat_gloss"}}
                                      : std::vector<Slot>{{"spec_trans"}, {"diff_trans", 0, 2}, {"eta", 1, 2}};
    slots.insert(slots.end(), own.begin(), own.end());
    return slots;
}

/// A BSDF whose slot `i` is of a checkerboard of two of these values, or of one, and all others of one.
std::string with_slots(const std::string& plugin, size_t textured, float a, float b) {
    std::string xml = "<shape type='rectangle'><bsdf type='" + plugin + "'>";
    const std::vector<Slot> slots = slots_of(plugin);
    for (size_t i = 0; i < slots.size(); ++i) {
        const auto of = [&](float share) {
            return std::to_string(slots[i].lower + share * (slots[i].upper - slots[i].lower));
        };
        const std::string name = std::string(" name='") + slots[i].name + "'";
        if (i == textured && a != b)  // as a number, the colours are exchanged
            xml += "<texture type='checkerboard'" + name + "><rgb name='color0' value='" + of(b) +
                   "'/><rgb name='color1' value='" + of(a) + "'/></texture>";
        else
            xml += "<float" + name + " value='" + of(i == textured ? a : 0.3f + 0.05f * float(i)) + "'/>";
    }
    return xml + "</bsdf></shape>";
}

/// What of the BSDF does not depend on where it lies in a scene, at texture coordinates `uv`.
template <class Model>
std::vector<float> at(const Scene& s, Vec2f uv) {
    const SceneView view = s.view();
    const BsdfRecord& record = s.bsdfs[s.materials[s.shapes[0].material].front];
    const Bsdf found = resolve_bsdf<kAllFeatures>(view, record, uv);
    // As vertices in queues have it.
    const Bsdf again = resolve_bsdf<kAllFeatures>(view, record, found.inputs);
    const Resolved<Model> p = found.as<Model>(), q = again.as<Model>();
    CHECK(memcmp(&p, &q, sizeof p) == 0);
    std::vector<float> all = {p.base_color.x, p.roughness, p.anisotropic, p.ior, p.specular_tint, p.sheen};
    for (const uint16_t share : {p.sheen_tint, p.flatness}) all.push_back(float(share) / 65535);
    if constexpr (std::is_same_v<Model, Principled>)
        for (const float x : {p.metallic, p.clearcoat, p.clearcoat_alpha}) all.push_back(x);
    else
        for (const float x : {p.specular, p.through}) all.push_back(x);
    return all;
}

void check_same(const std::vector<float>& a, const std::vector<float>& b) {
    REQUIRE(a.size() == b.size());
    for (size_t i = 0; i < a.size(); ++i) CHECK(a[i] == Approx(b[i]).epsilon(1e-6).margin(1e-7));
}

template <class Model>
void check_every_slot() {
    const std::string plugin = Model::plugin;
    const size_t count = slots_of(plugin).size();
    for (size_t i = 0; i < count; ++i) {
        INFO(plugin << ' ' << slots_of(plugin)[i].name);
        const Scene both = load(with_slots(plugin, i, 0.25f, 0.75f)), low = load(with_slots(plugin, i, 0.25f, 0.25f)),
                    high = load(with_slots(plugin, i, 0.75f, 0.75f));
        CHECK(both.features.textures);
        CHECK(!low.features.textures);
        check_same(at<Model>(both, {0.2f, 0.2f}), at<Model>(low, {0.2f, 0.2f}));
        CHECK(at<Model>(low, {}) != at<Model>(high, {}));
        check_same(at<Model>(both, {0.2f, 0.7f}), at<Model>(high, {0.2f, 0.7f}));
        const TempFolder folder;
        write_mitsuba(both, folder / "out.xml");
        const Scene read = load_mitsuba(folder / "out.xml");
        CHECK(read.features == both.features);
        for (const Vec2f uv : {Vec2f{0.2f, 0.2f}, {0.2f, 0.7f}}) check_same(at<Model>(read, uv), at<Model>(both, uv));
    }
}

}  // namespace

TEST_CASE("principled, principledthin: a texture in every slot, resolved, written and read again") {
    check_every_slot<Principled>();
    check_every_slot<PrincipledThin>();
    // A record that has them is no longer than before.
    CHECK(sizeof(BsdfRecord) == 88);
    CHECK(sizeof(BsdfInputs) == 32);
}

TEST_CASE("collimated and directionalarea: a ray with power, a shape with power per area") {
    const Scene s = load_quietly(
        "<emitter type='collimated'><transform name='toWorld'><lookat origin='1,2,3' target='1,2,0' up='0,1,0'/>"
        "</transform><rgb name='power' value='1,2,3'/></emitter><shape type='cube'><emitter type='directionalarea'>"
        "<rgb name='radiance' value='4,5,6'/></emitter></shape>",
        "0.6.0");
    REQUIRE(s.emitters.size() == 2);
    const Emitter &beam = s.emitters[0], &area = s.emitters[1];
    CHECK(beam.type == EmitterType::collimated);
    check_rgb(beam.position, {1, 2, 3});
    check_rgb(beam.direction, {0, 0, -1});
    check_rgb(beam.radiance.value, {1, 2, 3});
    CHECK(area.type == EmitterType::directional_area);
    CHECK(s.shapes[area.shape].emitter == 1);
    CHECK(area.area_cdf != kNone);
    // Picked by power: luminances, and an area of 24.
    CHECK(beam.pick_probability / area.pick_probability ==
          Approx(luminance(beam.radiance.value) / (24 * luminance(area.radiance.value))).epsilon(0.01));
    CHECK(s.features.has_beams());
    // No rays of this emitter meet anything by chance: it is on no list of hits.
    CHECK(contains(error_of("<emitter type='directionalarea'/>"), "emitter type 'directionalarea' is not supported"));
    CHECK(contains(error_of("<shape type='cube'><emitter type='collimated'/></shape>"),
                   "emitter type 'collimated' on a shape is not supported"));
    CHECK(contains(error_of("<emitter type='collimated'><transform name='to_world'><scale x='2'/></transform>"
                            "</emitter>"),
                   "must not shear, or scale one axis more than another"));
}

TEST_CASE("thin sheets and beams are written as they were read") {
    const Scene a = load_quietly(
        "<emitter type='collimated'><transform name='to_world'><lookat origin='1,2,3' target='0,0.5,0' up='0,1,0'/>"
        "</transform><rgb name='power' value='1,2,3'/></emitter><shape type='cube'><bsdf type='principledthin'><rgb "
        "name='base_color' value='.2,.3,.4'/><float name='spec_trans' value='.3'/><float name='diff_trans' "
        "value='1.6'/><texture name='anisotropic' type='checkerboard'/>"
        "<float name='sheen' value='.5'/></bsdf><emitter type='directionalarea'><rgb name='radiance' value='4,5,6'/>"
        "</emitter></shape>");
    const TempFolder folder;
    const std::vector<std::string> notes = write_mitsuba(a, folder / "out.xml");
    CHECK(std::count(notes.begin(), notes.end(), "Mitsuba 3 has no emitter 'collimated'") == 1);
    const Scene b = load_mitsuba(folder / "out.xml");
    CHECK(b.features == a.features);
    REQUIRE(b.emitters.size() == 2);
    check_rgb(b.emitters[0].position, a.emitters[0].position);
    check_rgb(b.emitters[0].direction, a.emitters[0].direction);
    check_rgb(b.emitters[0].radiance.value, a.emitters[0].radiance.value);
    check_rgb(b.emitters[1].radiance.value, a.emitters[1].radiance.value);
    const auto thin = [](const Scene& s) {
        return parameters<PrincipledThin>(s.bsdfs[s.materials[s.shapes[0].material].front]);
    };
    CHECK(thin(b).through == Approx(thin(a).through));
    CHECK(thin(b).specular.value == thin(a).specular.value);
    CHECK(thin(b).sheen == thin(a).sheen);
    for (const Vec2f uv : {Vec2f{0.1f, 0.1f}, {0.6f, 0.1f}})
        CHECK(eval_float<kAllFeatures>(b.view(), thin(b).anisotropic, uv) ==
              Approx(eval_float<kAllFeatures>(a.view(), thin(a).anisotropic, uv)));
}
