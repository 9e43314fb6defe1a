// libs: ambilux_formats
// timeout: 60
// Materials and textures of pbrt scenes.
#include <cmath>

#include "formats/images/image_write.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

const BsdfRecord& bsdf(const Scene& s, size_t shape = 0) {
    return s.bsdfs[s.materials[s.shapes[shape].material].front];
}

Scene with_material(const std::string& material) {
    return load_pbrt_world("Material " + material + "\n" + kUnitSphere);
}

}  // namespace

TEST_CASE("materials become the models that they are") {
    const auto type = [](const std::string& material) { return bsdf(with_material(material)).type; };
    CHECK(type("\"diffuse\"") == BsdfType::diffuse);
    CHECK(type("\"coateddiffuse\"") == BsdfType::plastic);
    CHECK(type("\"coateddiffuse\" \"float roughness\" .1") == BsdfType::rough_plastic);
    CHECK(type("\"conductor\"") == BsdfType::conductor);
    CHECK(type("\"conductor\" \"float roughness\" .1") == BsdfType::rough_conductor);
    CHECK(type("\"coatedconductor\"") == BsdfType::conductor);
    CHECK(type("\"dielectric\"") == BsdfType::dielectric);
    CHECK(type("\"dielectric\" \"float uroughness\" .1 \"float vroughness\" .2") == BsdfType::rough_dielectric);
    CHECK(type("\"thindielectric\"") == BsdfType::thin_dielectric);
    CHECK(with_material("\"diffuse\"").materials[0].two_sided == 1);

    const Scene rough =
        with_material("\"dielectric\" \"float uroughness\" .04 \"float vroughness\" .09 \"float eta\" 1.3");
    const auto& p = bsdf(rough).as<RoughDielectric>();
    CHECK(p.alpha_u.value == Approx(0.2f));
    CHECK(p.alpha_v.value == Approx(0.3f));
    CHECK(p.ior == Approx(1.3f));
    CHECK(p.distribution == Microfacets::ggx);
    const Scene plain = with_material("\"conductor\" \"float roughness\" .04 \"bool remaproughness\" false");
    CHECK(bsdf(plain).as<RoughConductor>().alpha_u.value == Approx(0.04f));

    const Scene gold = with_material("\"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\"");
    check_rgb(bsdf(gold).as<Conductor>().eta, {0.143036f, 0.375307f, 1.44205f});
    const Scene grey = with_material("\"conductor\" \"rgb reflectance\" [.5 .5 .5]");
    check_rgb(bsdf(grey).as<Conductor>().k, splat(2));  // k² = 4 R/(1-R)
    CHECK(has_note(with_material("\"coateddiffuse\""), "coateddiffuse is approximated by plastic"));
    CHECK(has_note(with_material("\"coatedconductor\""), "coatedconductor is approximated by conductor"));
}

TEST_CASE("a mix and a diffuse transmission are blends whose sum is what was asked for") {
    const Scene s = load_pbrt_world(
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string type\" \"dielectric\"\n"
        "Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" .3\n" +
        kUnitSphere +
        "Material \"diffusetransmission\" \"rgb reflectance\" [.1 .2 .3] \"rgb transmittance\" [.4 .1 .2]\n" +
        kUnitSphere);
    const Material& mix = s.materials[s.shapes[0].material];
    CHECK(mix.second_weight.value == Approx(0.3f));
    CHECK(s.bsdfs[s.materials[mix.second].front].type == BsdfType::dielectric);
    const Material& both = s.materials[s.shapes[1].material];
    const float w = both.second_weight.value;
    check_rgb(s.bsdfs[s.materials[both.first].front].as<Diffuse>().reflectance.value * (1 - w), {0.1f, 0.2f, 0.3f});
    check_rgb(s.bsdfs[s.materials[both.second].front].as<DiffuseTransmitter>().transmittance.value * w,
              {0.4f, 0.1f, 0.2f});
}

TEST_CASE("diffuse transmission with images: shares of the blend leave room for the brightest texel") {
    const TempFolder folder;
    folder.write("t.png", png_bytes(2, 1, {255, 255, 255, 0, 0, 0}));
    const auto load = [&](const std::string& scale, const std::string& t) {
        return load_pbrt_world(
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\" "
            "\"float scale\" " +
                scale + "\nMaterial \"diffusetransmission\" \"texture reflectance\" \"t\" \"rgb transmittance\" [" + t +
                "]\n" + kUnitSphere,
            {}, &folder);
    };
    const Scene s = load(".75", ".25 .1 .2");
    const Material& both = s.materials[s.shapes[0].material];
    const float w = both.second_weight.value;
    const ParamRgb& r = s.bsdfs[s.materials[both.first].front].as<Diffuse>().reflectance;
    Rgb brightest{};
    for (const float u : {0.25f, 0.75f}) brightest = max(brightest, eval_rgb<kAllFeatures>(s.view(), r, {u, 0.5f}));
    check_rgb(brightest * (1 - w), splat(0.75f), 1e-3);
    check_rgb(s.bsdfs[s.materials[both.second].front].as<DiffuseTransmitter>().transmittance.value * w,
              {0.25f, 0.1f, 0.2f});
    CHECK(has_note(load("1", ".5 .5 .5"), "add up to more than 1: both are clipped"));
    CHECK(contains(pbrt_error("WorldBegin Material \"diffusetransmission\" \"rgb reflectance\" [.6 .5 .1] "
                              "\"rgb transmittance\" [.2 .4 .6] Shape \"sphere\""),
                   "of diffusetransmission add up to more than 1, which is not supported"));
}

TEST_CASE("textures: t runs upwards, constants and images fold, checkerboards have cells of size 1") {
    const TempFolder folder;
    // Rows from the top: red green / blue white.
    folder.write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}));
    const std::string
        image = "Texture \"i\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\"\n",
        quad =
            "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"point2 uv\" [0 0 1 0 1 1 0 1] "
            "\"integer indices\" [0 1 2 0 2 3]\n";
    const auto at = [&](const std::string& textures, Vec2f uv) {
        const Scene s = load_pbrt_world(
            image + textures + "Material \"diffuse\" \"texture reflectance\" \"t\"\n" + quad, {}, &folder);
        return reflectance(s, 0, uv);
    };
    const std::string
        scaled = "Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"i\" \"float scale\" .5\n",
        mixed = "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"i\" \"rgb tex2\" [1 1 1] \"float amount\" .25\n",
        inverted =
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"bool invert\" true \"string "
            "filter\" \"point\"\n",
        checker =
            "Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"rgb tex1\" [.1 .2 .3] \"rgb tex2\" [.4 "
            ".5 .6]\n";
    check_rgb(at(scaled, {0.25f, 0.75f}), {0.5f, 0, 0});
    check_rgb(at(scaled, {0.75f, 0.75f}), {0, 0.5f, 0});
    check_rgb(at(scaled, {0.25f, 0.25f}), {0, 0, 0.5f});
    check_rgb(at(mixed, {0.25f, 0.75f}), {1, 0.25f, 0.25f});
    check_rgb(at(inverted, {0.25f, 0.75f}), {0, 1, 1});
    check_rgb(at(checker, {0.1f, 0.5f}), {0.1f, 0.2f, 0.3f});
    check_rgb(at(checker, {0.3f, 0.5f}), {0.4f, 0.5f, 0.6f});
    check_rgb(at(checker, {0.6f, 0.5f}), {0.1f, 0.2f, 0.3f});
}

TEST_CASE("images lie on spheres, disks and cylinders as pbrt has them") {
    const TempFolder folder;
    folder.write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}));
    const Scene s = load_pbrt_world(
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\" Material "
        "\"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\" Shape \"disk\" Shape \"cylinder\"",
        {}, &folder);
    // Coordinates of shapes are Mitsuba's: azimuth and angle to +z; radius and azimuth; azimuth and height.
    check_rgb(reflectance(s, 0, {0.25f, 0.1f}), {1, 0, 0});  // the top of the image is the pole +z
    check_rgb(reflectance(s, 0, {0.75f, 0.9f}), {1, 1, 1});
    check_rgb(reflectance(s, 1, {0.25f, 0.1f}), {1, 0, 0});  // and the centre of the disk, where pbrt's v is 1
    check_rgb(reflectance(s, 1, {0.75f, 0.6f}), {1, 1, 1});
    check_rgb(reflectance(s, 2, {0.25f, 0.9f}), {1, 0, 0});
    check_rgb(reflectance(s, 2, {0.75f, 0.1f}), {1, 1, 1});
}

TEST_CASE("factors of textures: reflectances end at 1, heights may be negative, coatings have a mean roughness") {
    const TempFolder folder;
    folder.write("t.png", png_bytes(2, 1, {255, 255, 255, 0, 0, 0}));
    const std::string
        image = "\"imagemap\" \"string filename\" \"t.png\" \"string filter\" \"point\" \"string encoding\" \"linear\"",
        quad =
            "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0] \"point2 uv\" [0 0 1 0 1 1] \"integer indices\" "
            "[0 1 2]";
    const Scene s =
        load_pbrt_world("Texture \"t\" \"spectrum\" " + image + " \"float scale\" 3 Texture \"b\" \"float\" " + image +
                            " \"float scale\" -2\n"
                            "Texture \"r\" \"float\" " +
                            image +
                            " \"float scale\" .5\n"
                            "Material \"diffuse\" \"texture reflectance\" \"t\" \"texture displacement\" \"b\" " +
                            quad + " Material \"coateddiffuse\" \"texture roughness\" \"r\" " + quad,
                        {}, &folder);
    check_rgb(reflectance(s, 0, {0.25f, 0.5f}), splat(1));
    CHECK(bsdf(s).bump_map >= 0);
    CHECK(bsdf(s).bump_scale == -2);
    CHECK(bsdf(s).map_rules == 0);
    CHECK(bsdf(s, 1).as<RoughPlastic>().alpha.value == Approx(0.5f));
    CHECK(has_note(s, "mean of its roughness"));
}

TEST_CASE("textures of textures on one grid") {
    const TempFolder folder;
    write_float_image(folder / "wide.exr", 4, 1, {0, 0, 0, .2f, .2f, .2f, .4f, .4f, .4f, .6f, .6f, .6f});
    write_float_image(folder / "tall.exr", 1, 2, {1, 1, 1, .5f, .5f, .5f});
    const auto image = [](const std::string& name, const std::string& file, const std::string& more = "") {
        return "Texture \"" + name + "\" \"spectrum\" \"imagemap\" \"string filter\" \"point\" \"string filename\" \"" +
               file + "\" " + more;
    };
    const auto shown = [&](const std::string& textures) {
        return load_pbrt_world(
            textures +
                " Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"trianglemesh\" \"point3 P\" "
                "[0 0 0 1 0 0 1 1 0] \"integer indices\" [0 1 2] \"point2 uv\" [0 0 1 0 1 1]",
            {}, &folder);
    };
    const std::string both = image("a", "wide.exr") + image("b", "tall.exr");
    const Scene mixed = shown(
        both + "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"texture tex2\" \"b\" \"float amount\" .25");
    CHECK(has_note(mixed, "one grid of texels"));
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x) {
            const Vec2f uv = {(float(x) + 0.5f) / 4, (float(y) + 0.5f) / 2};  // v = 0 is the last row of a file
            CHECK(reflectance(mixed, 0, uv).x == Approx(0.75 * 0.2 * x + 0.25 * (y ? 1 : 0.5)));
        }
    // A checkerboard of 4 by 4 cells, of an image and a colour.
    const std::string board =
        "Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 4 "
        "\"texture tex1\" \"a\" \"rgb tex2\" [.9 .9 .9]";
    const Scene checkered = shown(image("a", "wide.exr") + board);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x)
            CHECK(reflectance(checkered, 0, {(float(x) + 0.4f) / 4, (float(y) + 0.4f) / 4}).x ==
                  Approx((x + y) % 2 == 0 ? 0.2 * x : 0.9));
    CHECK(contains(pbrt_error("WorldBegin " + image("a", "wide.exr", "\"float uscale\" 1.5 ") + image("b", "tall.exr") +
                                  "Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"a\" \"texture scale\" \"b\"",
                              {}, &folder),
                   "no texture of type float"));
    CHECK(contains(pbrt_error("WorldBegin " + image("a", "wide.exr", "\"float uscale\" 1.5 ") + image("b", "tall.exr") +
                                  "Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"texture tex2\" \"b\"",
                              {}, &folder),
                   "whose periods do not fit"));
    const Scene corners = shown(
        "Texture \"t\" \"spectrum\" \"bilerp\" \"rgb v00\" [0 0 0] \"rgb v10\" [.4 .4 .4] \"rgb v01\" "
        "[.8 .8 .8] \"rgb v11\" [1 1 1]");
    for (float u : {0.0f, 0.3f, 1.0f})
        for (float v : {0.0f, 0.7f, 1.0f})
            CHECK(reflectance(corners, 0, {u, v}).x ==
                  Approx((1 - v) * u * 0.4 + v * ((1 - u) * 0.8 + u)).margin(1e-5));

    // Centres by Perlin's noise, computed by a program of its own.
    const Scene dots = shown(
        "Texture \"t\" \"spectrum\" \"dots\" \"float uscale\" 4 \"float vscale\" 4 \"float vdelta\" 1 "
        "\"rgb inside\" [1 .5 0] \"rgb outside\" [0 .25 1]");
    CHECK(has_note(dots, "dots are an image of 256 texels a side"));
    const auto at = [&](double x, double y) { return reflectance(dots, 0, {float(x / 4), float((y - 1) / 4)}); };
    const Vec2f centres[] = {{1.1132f, 2.0119f}, {2.0509f, 2.9011f}, {3.0247f, 3.9469f}};
    for (const Vec2f c : centres)
        for (int k = 0; k < 8; ++k) {
            const double x = std::cos(k * M_PI / 4), y = std::sin(k * M_PI / 4);
            check_rgb(at(c.x + 0.32 * x, c.y + 0.32 * y), {1, 0.5f, 0});
            check_rgb(at(c.x + 0.38 * x, c.y + 0.38 * y), {0, 0.25f, 1});
        }
    check_rgb(at(1, 4), {0, 0.25f, 1});
    check_rgb(at(2, 1.3), {0, 0.25f, 1});
}

TEST_CASE("attributes of materials count for named ones too") {
    const auto alpha = [](const std::string& material) {
        const Scene s =
            load_pbrt_world("Attribute \"material\" \"float roughness\" 0.04 " + material + " Shape \"sphere\"");
        const BsdfRecord& r = s.bsdfs[s.materials[s.shapes[0].material].front];
        REQUIRE(r.type == BsdfType::rough_conductor);
        return r.as<RoughConductor>().alpha_u.value;
    };
    CHECK(alpha("Material \"conductor\"") == Approx(0.2));
    CHECK(alpha("MakeNamedMaterial \"m\" \"string type\" \"conductor\" NamedMaterial \"m\"") == Approx(0.2));
    CHECK(alpha("MakeNamedMaterial \"m\" \"string type\" \"conductor\" \"float roughness\" .09 NamedMaterial \"m\"") ==
          Approx(0.3));
}
