// libs: ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 120
// Masks, blends, two-sided surfaces and maps inside of each other: opacities and weights of what a nesting becomes.
#include <map>

#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "transport/opacity.h"
#include "transport/resolve_bsdf.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

std::string number(const std::string& name, double value) {
    return "<float name='" + name + "' value='" + std::to_string(value) + "'/>";
}
std::string diffuse(double reflectance) {
    const std::string r = std::to_string(reflectance);
    return "<bsdf type='diffuse'><rgb name='reflectance' value='" + r + "," + r + "," + r + "'/></bsdf>";
}
std::string nested(const std::string& type, const std::string& inside) {
    return "<bsdf type='" + type + "'>" + inside + "</bsdf>";
}
std::string mask(double opacity, const std::string& inside) {
    return nested("mask", number("opacity", opacity) + inside);
}
std::string mask(const std::string& texture, const std::string& inside) { return nested("mask", texture + inside); }
std::string blend(double weight, const std::string& inside) {
    return nested("blendbsdf", number("weight", weight) + inside);
}

/// What a ray meets at texture coordinates `uv` of the shape, by its reflectance: the chances of all that there is.
struct Chances {
    double opacity = 0;
    std::map<float, double> of;  ///< given that the surface is met
};

void collect(const Scene& s, uint32_t index, Vec2f uv, bool back, double chance, Chances& out) {
    const Material& m = s.materials[index];
    if (m.first == kNone) {
        const BsdfRecord& record = s.bsdfs[back ? m.back : m.front];
        out.of[eval_rgb<kAllFeatures>(s.view(), record.as<Diffuse>().reflectance, uv).x] += chance;
        return;
    }
    const double weight = eval_float<kAllFeatures>(s.view(), m.second_weight, uv);
    for (const auto& [part, share] : {std::pair{m.first, 1 - weight}, {m.second, weight}}) {
        CHECK(s.materials[part].opacity.value == 1.0f);  // nobody looks at that of a part
        collect(s, part, uv, back, chance * share, out);
    }
}

Chances chances(const Scene& s, Vec2f uv = {0.25f, 0.25f}, bool back = false) {
    Chances out;
    const uint32_t index = s.shapes[0].material;
    out.opacity = surface_opacity<kAllFeatures>(s.view(), s.materials[index], uv);
    collect(s, index, uv, back, 1, out);
    return out;
}

Scene rectangle(const std::string& bsdf, const TempFolder* folder = nullptr) {
    return load_quietly("<shape type='rectangle'>" + bsdf + "</shape>", "3.0.0", folder);
}

/// A blend of parts a and b behind masks.
void check_blend(const Chances& c, double weight, double a, double b, float of_a = 0.2f, float of_b = 0.8f) {
    const double whole = (1 - weight) * a + weight * b;
    CHECK(c.opacity == Approx(whole).margin(1e-6));
    if (whole == 0) return;
    const auto chance = [&](float r) {
        double sum = 0;
        for (const auto& [reflectance, p] : c.of)
            if (std::fabs(reflectance - r) < 1e-3f) sum += p;
        return sum;
    };
    CHECK(chance(of_a) == Approx((1 - weight) * a / whole).margin(1e-5));
    CHECK(chance(of_b) == Approx(weight * b / whole).margin(1e-5));
}

}  // namespace

TEST_CASE("masks inside of blends") {
    check_blend(chances(rectangle(blend(0.3, mask(0.5, diffuse(0.2)) + diffuse(0.8)))), 0.3, 0.5, 1);
    check_blend(chances(rectangle(blend(0.3, mask(0.5, diffuse(0.2)) + mask(0.25, diffuse(0.8))))), 0.3, 0.5, 0.25);
    check_blend(chances(rectangle(blend(0.3, mask(0.5, diffuse(0.2)) + mask(0.5, diffuse(0.8))))), 0.3, 0.5, 0.5);
    // Around all of it a mask and a map, in either order.
    const std::string inner = blend(0.3, mask(0.5, diffuse(0.2)) + diffuse(0.8));
    const Chances masked = chances(rectangle(mask(0.5, inner)));
    CHECK(masked.opacity == Approx(0.5 * (0.7 * 0.5 + 0.3)));
    CHECK(chances(rectangle(mask(0.5, mask(0.25, diffuse(0.2))))).opacity == Approx(0.125));
    // Blends of blends.
    const Chances deep = chances(rectangle(blend(0.5, inner + mask(0.4, diffuse(0.6)))));
    CHECK(deep.opacity == Approx(0.5 * (0.7 * 0.5 + 0.3) + 0.5 * 0.4));
    CHECK(deep.of.at(0.6f) == Approx(0.5 * 0.4 / deep.opacity));
    // Mixtures.
    const Chances mixed =
        chances(rectangle(nested("mixturebsdf", "<string name='weights' value='.5, .25, .25'/>" +
                                                    mask(0.2, diffuse(0.2)) + diffuse(0.8) + mask(0.6, diffuse(0.6)))));
    CHECK(mixed.opacity == Approx(0.5 * 0.2 + 0.25 + 0.25 * 0.6));
    CHECK(mixed.of.at(0.2f) == Approx(0.5 * 0.2 / mixed.opacity));
    CHECK(mixed.of.at(0.6f) == Approx(0.25 * 0.6 / mixed.opacity));
    const Chances alone =
        chances(rectangle(mask(0.5, nested("mixturebsdf", "<string name='weights' value='1'/>" + diffuse(0.2)))));
    CHECK(alone.opacity == 0.5);
}

TEST_CASE("null inside of blends is a mask, wherever it stands") {
    const std::string null = "<bsdf type='null'/>";
    const Scene first = rectangle(blend(0.3, null + diffuse(0.8)));
    CHECK(chances(first).opacity == Approx(0.3));
    CHECK(first.materials[first.shapes[0].material].first == kNone);  // no blend is left
    CHECK(chances(rectangle(blend(0.3, diffuse(0.8) + null))).opacity == Approx(0.7));
    check_blend(chances(rectangle(blend(0.5, blend(0.3, null + diffuse(0.2)) + diffuse(0.8)))), 0.5, 0.3, 1);
    CHECK(chances(rectangle(mask(0.5, blend(0.3, null + diffuse(0.8))))).opacity == Approx(0.15));
    CHECK(chances(rectangle(nested("twosided", diffuse(0.2)))).opacity == 1);
    CHECK(contains(error_of("<shape type='rectangle'>" + nested("twosided", null) + "</shape>"),
                   "cannot be inside of twosided"));
}

TEST_CASE("opacities and weights from textures") {
    const TempFolder folder;
    // Columns of 0, 1/3, 2/3, 1.
    folder.write("ramp.png", png_bytes(4, 1, {0, 0, 0, 85, 85, 85, 170, 170, 170, 255, 255, 255}));
    folder.write("two.png", png_bytes(2, 2, {255, 255, 255, 51, 51, 51, 51, 51, 51, 255, 255, 255}));
    const auto texture = [](const std::string& name, const std::string& file, const std::string& more = "") {
        return "<texture type='bitmap' name='" + name + "'><string name='filename' value='" + file +
               "'/><boolean name='raw' value='true'/><string name='filter_type' value='nearest'/>" + more +
               "</texture>";
    };
    const std::string ramp = texture("opacity", "ramp.png");
    // 1 - texture: a mask by a blend whose second part is not there.
    const Scene gone =
        rectangle(nested("blendbsdf", texture("weight", "ramp.png") + diffuse(0.8) + "<bsdf type='null'/>"), &folder);
    for (int i = 0; i < 4; ++i)
        CHECK(chances(gone, {(float(i) + 0.5f) / 4, 0.5f}).opacity == Approx(1 - i / 3.0).margin(1e-6));
    // Two textures of different sizes, a number and a checkerboard.
    const Scene both = rectangle(
        nested("blendbsdf", texture("weight", "two.png") + mask(ramp, diffuse(0.2)) + mask(0.5, diffuse(0.8))),
        &folder);
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x)
            check_blend(chances(both, {(float(x) + 0.5f) / 4, (float(y) + 0.5f) / 2}), (x / 2 == y) ? 1.0 : 0.2,
                        x / 3.0, 0.5);
    const Scene product = rectangle(mask(ramp, mask("<texture type='checkerboard' name='opacity'><rgb name='color0' "
                                                    "value='.5,.5,.5'/><rgb name='color1' value='1,1,1'/></texture>",
                                                    diffuse(0.2))),
                                    &folder);
    for (int x = 0; x < 4; ++x) {
        // As a number, a checkerboard of format 3 has its colours exchanged.
        CHECK(chances(product, {(float(x) + 0.5f) / 4, 0.25f}).opacity == Approx(x / 3.0 * (x < 2 ? 1 : 0.5)));
        CHECK(chances(product, {(float(x) + 0.5f) / 4, 0.75f}).opacity == Approx(x / 3.0 * (x < 2 ? 0.5 : 1)));
    }
    // Twice as often along u.
    const Scene dense =
        rectangle(mask(texture("opacity", "two.png", "<transform name='to_uv'><scale x='2' y='1'/></transform>"),
                       mask(ramp, diffuse(0.2))),
                  &folder);
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x)
            CHECK(chances(dense, {(float(x) + 0.5f) / 4, (float(y) + 0.5f) / 2}).opacity ==
                  Approx((x % 2 == y ? 1.0 : 0.2) * x / 3.0).margin(1e-6));
    const std::string scaled = "<transform name='to_uv'><scale x='1.5' y='1'/></transform>";
    CHECK(contains(error_of("<shape type='rectangle'>" +
                                mask(ramp, mask(texture("opacity", "two.png", scaled), diffuse(0.2))) + "</shape>",
                            {}, "3.0.0", &folder),
                   "must have the same wrap mode, and coordinates that fit"));
}

TEST_CASE("what is interpolated is combined more finely") {
    const TempFolder folder;
    folder.write("ramp.png", png_bytes(4, 1, {0, 0, 0, 85, 85, 85, 170, 170, 170, 255, 255, 255}));
    const std::string ramp =
        "<texture type='bitmap' name='opacity'><string name='filename' value='ramp.png'/><boolean "
        "name='raw' value='true'/><string name='wrap_mode' value='clamp'/></texture>";
    const Scene plain = rectangle(mask(ramp, diffuse(0.2)), &folder),
                inverse = rectangle(nested("blendbsdf", std::string(ramp).replace(ramp.find("opacity"), 7, "weight") +
                                                            diffuse(0.8) + "<bsdf type='null'/>"),
                                    &folder),
                square = rectangle(mask(ramp, mask(ramp, diffuse(0.2))), &folder);
    for (int i = 0; i <= 40; ++i) {
        const Vec2f uv = {float(i) / 40, 0.5f};
        const double o = chances(plain, uv).opacity;
        CHECK(chances(inverse, uv).opacity == Approx(1 - o).margin(1e-6));  // linear functions exactly
        CHECK(chances(square, uv).opacity == Approx(o * o).margin(0.0012));
    }
}

TEST_CASE("two-sided surfaces hold masks and blends on either side") {
    const Scene one = rectangle(nested("twosided", mask(0.5, diffuse(0.2))));
    CHECK(chances(one).opacity == 0.5);
    CHECK(one.materials[one.shapes[0].material].two_sided);
    CHECK(has_note(one, "a mask inside of twosided"));
    CHECK(chances(rectangle(nested("twosided", mask(0.5, diffuse(0.2)) + mask(0.5, diffuse(0.8))))).opacity == 0.5);
    CHECK(contains(
        error_of("<shape type='rectangle'>" + nested("twosided", mask(0.5, diffuse(0.2)) + diffuse(0.8)) + "</shape>"),
        "must have the same opacity"));
    const Scene sides = rectangle(
        nested("twosided", blend(0.25, diffuse(0.2) + diffuse(0.8)) + blend(0.5, diffuse(0.4) + diffuse(0.6))));
    const Chances front = chances(sides), back = chances(sides, {0.25f, 0.25f}, true);
    CHECK(front.of == std::map<float, double>{{0.2f, 0.75}, {0.8f, 0.25}});
    CHECK(back.of == std::map<float, double>{{0.4f, 0.5}, {0.6f, 0.5}});
    // One inside of another is met on its front.
    const Scene inner = rectangle(nested("twosided", nested("twosided", diffuse(0.2) + diffuse(0.8))));
    CHECK(chances(inner).of == std::map<float, double>{{0.2f, 1}});
    CHECK(chances(inner, {0.25f, 0.25f}, true).of == std::map<float, double>{{0.2f, 1}});
}

TEST_CASE("principled: transmission with textures") {
    const TempFolder folder;
    folder.write("c.png", png_bytes(2, 1, {255, 0, 51, 51, 255, 0}));
    const auto texture = [](const std::string& name) {
        return "<texture type='bitmap' name='" + name +
               "'><string name='filename' value='c.png'/><boolean name='raw' value='true'/></texture>";
    };
    const Scene glass = rectangle(nested("principled", number("spec_trans", 1) + texture("base_color")), &folder);
    const BsdfRecord& record = glass.bsdfs[glass.materials[glass.shapes[0].material].front];
    const auto p = parameters<RoughDielectric>(record);
    check_rgb(eval_rgb<kAllFeatures>(glass.view(), p.specular_transmittance, {0.25f, 0.5f}), {1, 0, std::sqrt(0.2f)});
    const Scene shared = rectangle(
        nested("principled", number("spec_trans", 0.5) + texture("metallic") + texture("roughness")), &folder);
    const Material& m = shared.materials[shared.shapes[0].material];
    REQUIRE(m.first != kNone);
    const float metal = luminance({0.2f, 1, 0});
    CHECK(eval_float<kAllFeatures>(shared.view(), m.second_weight, {0.75f, 0.5f}) == Approx((1 - metal) * 0.5));
    const auto opaque = parameters<Principled>(shared.bsdfs[shared.materials[m.first].front]);
    CHECK(eval_float<kAllFeatures>(shared.view(), opaque.metallic, {0.75f, 0.5f}) ==
          Approx(metal / (1 - (1 - metal) * 0.5)));
    const auto rough = parameters<RoughDielectric>(shared.bsdfs[shared.materials[m.second].front]);
    CHECK(eval_float<kAllFeatures>(shared.view(), rough.alpha_u, {0.75f, 0.5f}) == Approx(metal * metal));
    // A third number, of a glass as two of its own.
    const Scene turned = rectangle(
        nested("principled", number("spec_trans", 0.5) + texture("anisotropic") + texture("roughness")), &folder);
    const Material& t = turned.materials[turned.shapes[0].material];
    const auto front = parameters<Principled>(turned.bsdfs[turned.materials[t.first].front]);
    CHECK(eval_float<kAllFeatures>(turned.view(), front.anisotropic, {0.75f, 0.5f}) == Approx(metal));
    const auto glossy = parameters<RoughDielectric>(turned.bsdfs[turned.materials[t.second].front]);
    const double aspect = std::sqrt(1 - 0.9 * double(metal));
    CHECK(eval_float<kAllFeatures>(turned.view(), glossy.alpha_u, {0.75f, 0.5f}) == Approx(metal * metal / aspect));
    CHECK(eval_float<kAllFeatures>(turned.view(), glossy.alpha_v, {0.75f, 0.5f}) == Approx(metal * metal * aspect));
    const Scene thin = rectangle(nested("principledthin", texture("anisotropic") + texture("spec_trans")), &folder);
    const auto sheet = parameters<PrincipledThin>(thin.bsdfs[thin.materials[thin.shapes[0].material].front]);
    CHECK(eval_float<kAllFeatures>(thin.view(), sheet.anisotropic, {0.75f, 0.5f}) == Approx(metal));
    CHECK(sheet.specular.texture == sheet.anisotropic.texture);
    LoadOptions lenient;
    lenient.lenient = true;
    const std::string other = "<shape type='rectangle'>" + nested("principled", texture("specular")) + "</shape>";
    CHECK(contains(error_of(other, {}, "3.0.0", &folder), "a texture as 'specular' is not supported"));
    CHECK(load(other, lenient, "3.0.0", &folder).warnings.size() == 1);
}

TEST_CASE("principled: what is not glass has the terms of all, texel by texel") {
    const TempFolder folder;
    // Texels of 0.2 and 0.6.
    folder.write("c.png", png_bytes(2, 1, {51, 51, 51, 153, 153, 153}));
    const auto texture = [](const std::string& name) {
        return "<texture type='bitmap' name='" + name +
               "'><string name='filename' value='c.png'/><boolean name='raw' value='true'/><string name='filter_type' "
               "value='nearest'/></texture>";
    };
    const auto opaque_at = [&](const Scene& s, float u) {
        const Material& m = s.materials[s.shapes[0].material];
        const BsdfRecord& record = s.bsdfs[s.materials[m.first == kNone ? s.shapes[0].material : m.first].front];
        return resolve_bsdf<kAllFeatures>(s.view(), record, Vec2f{u, 0.5f}).as<Principled>();
    };
    const Scene s =
        rectangle(nested("principled", texture("spec_trans") + number("metallic", 0.5) + number("spec_tint", 0.3) +
                                           number("sheen", 0.4) + number("clearcoat", 0.8)),
                  &folder);
    for (const auto& [u, st] : {std::pair{0.25f, 0.2}, {0.75f, 0.6}}) {
        const auto p = opaque_at(s, u);
        CHECK(p.specular_tint == Approx(0.3 / (1 - st)));
        CHECK(p.sheen == Approx(0.4 / (1 - st)));
        CHECK(p.clearcoat == Approx(0.8 / (1 - 0.5 * st)));
        CHECK(p.metallic == Approx(0.5 / (1 - 0.5 * st)));
    }
    const Scene t = rectangle(
        nested("principled", texture("metallic") + texture("sheen") + texture("clearcoat") + number("spec_trans", 0.5)),
        &folder);
    for (const auto& [u, v] : {std::pair{0.25f, 0.2}, {0.75f, 0.6}}) {
        CHECK(opaque_at(t, u).sheen == Approx(v / 0.5));
        CHECK(opaque_at(t, u).clearcoat == Approx(v / (1 - (1 - v) * 0.5)));
    }
    const auto error = [&](const std::string& xml) {
        return error_of("<shape type='rectangle'>" + nested("principled", xml) + "</shape>", {}, "3.0.0", &folder);
    };
    CHECK(contains(error(texture("spec_trans") + number("spec_tint", 0.5)), "spec_tint and spec_trans may be 1"));
    folder.write("c.png", png_bytes(2, 1, {255, 255, 255, 0, 0, 0}));
    CHECK(contains(error(texture("spec_trans") + number("clearcoat", 0.5)), "clearcoat on glass alone"));
    CHECK(contains(error(number("spec_trans", 1) + number("clearcoat", 0.5)), "clearcoat on glass alone"));
    // Where all is metal, none is glass.
    const Scene metal = rectangle(
        nested("principled", texture("spec_trans") + texture("metallic") + number("clearcoat", 0.5)), &folder);
    for (const float u : {0.25f, 0.75f}) CHECK(opaque_at(metal, u).clearcoat == 0.5f);
}
