// libs: ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 120
// BSDFs, adapters, spectra and textures of Mitsuba files. Numbers marked "Mitsuba" were read from Mitsuba 3.9.1.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/math.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "transport/bsdf/precompute.h"
#include "transport/texture.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// Record of the BSDF on a rectangle.
BsdfRecord bsdf(const std::string& xml, const std::string& version = "3.0.0") {
    const Scene s = load("<shape type='rectangle'>" + xml + "</shape>", {}, version);
    return s.bsdfs[s.materials[s.shapes[0].material].front];
}

}  // namespace

TEST_CASE("BSDFs: every type and its defaults") {
    CHECK(parameters<Diffuse>(bsdf("<bsdf type='diffuse'/>")).reflectance.value == splat(0.5f));
    CHECK(parameters<Diffuse>(bsdf("")).reflectance.value == splat(0.5f));
    CHECK(parameters<Diffuse>(bsdf("<emitter type='area'/>")).reflectance.value == splat(0.0f));
    CHECK(parameters<RoughDiffuse>(bsdf("<bsdf type='roughdiffuse'><float name='alpha' value='0.4'/></bsdf>"))
              .alpha.value == 0.4f);

    auto r = parameters<Conductor>(bsdf("<bsdf type='conductor'/>"));
    CHECK(r.eta == Vec3f{0, 0, 0});
    CHECK(r.k == Vec3f{1, 1, 1});
    r = parameters<Conductor>(bsdf("<bsdf type='conductor'><string name='material' value='Au'/></bsdf>"));
    check_rgb(r.eta, {0.143036f, 0.375307f, 1.442045f}, 1e-5);  // Mitsuba
    check_rgb(r.k, {3.982997f, 2.385556f, 1.603359f}, 1e-5);
    // The older generation: copper, relative to air.
    r = parameters<Conductor>(bsdf("<bsdf type='conductor'/>", "0.6.0"));
    CHECK(r.eta.x == Approx(0.201005 / 1.000277).epsilon(1e-5));
    auto rough = parameters<RoughConductor>(bsdf(
        "<bsdf type='roughconductor'><rgb name='eta' value='1,2,3'/><rgb name='k' value='4,5,6'/><float name='extEta' "
        "value='2'/></bsdf>",
        "0.6.0"));
    CHECK(rough.k == Vec3f{2, 2.5f, 3});
    rough = parameters<RoughConductor>(
        bsdf("<bsdf type='roughconductor'><string name='distribution' value='ggx'/><float name='alpha' "
             "value='0.25'/><spectrum name='eta' value='0.789'/><spectrum name='k' value='6.15'/><boolean "
             "name='sample_visible' value='false'/></bsdf>"));
    CHECK(rough.distribution == Microfacets::ggx);
    CHECK(rough.alpha_u.value == 0.25f);
    CHECK(rough.alpha_v.value == 0.25f);
    CHECK(rough.eta == splat(0.789f));
    CHECK(rough.sample_visible == 0);
    rough = parameters<RoughConductor>(bsdf("<bsdf type='roughconductor'/>"));
    CHECK(rough.distribution == Microfacets::beckmann);
    CHECK(rough.alpha_v.value == 0.1f);

    CHECK(parameters<Dielectric>(bsdf("<bsdf type='dielectric'/>")).ior == Approx(1.50418).epsilon(1e-5));  // Mitsuba
    CHECK(parameters<Dielectric>(bsdf("<bsdf type='dielectric'><string name='int_ior' value='Diamond'/><string "
                                      "name='ext_ior' value='vacuum'/></bsdf>"))
              .ior == 2.419f);
    CHECK(
        bsdf("<bsdf type='thindielectric'><float name='int_ior' value='1.3'/><float name='ext_ior' value='1'/></bsdf>")
            .type == BsdfType::thin_dielectric);
    CHECK(bsdf("<bsdf type='roughdielectric'/>").type == BsdfType::rough_dielectric);

    const auto coated = parameters<Plastic>(bsdf("<bsdf type='plastic'/>"));
    CHECK(coated.ior == Approx(1.48959).epsilon(1e-5));  // Mitsuba
    CHECK(coated.specular_sampling_weight == Approx(2.0 / 3));
    CHECK(coated.fdr_internal == fresnel_diffuse_reflectance(coated.ior));
    CHECK(coated.fdr_internal == Approx(0.590479).epsilon(0.01));  // Mitsuba's fit
    CHECK(coated.nonlinear == 0);

    const Scene s = load(
        "<shape type='rectangle'><bsdf type='roughplastic'><float name='alpha' value='0.2'/><boolean name='nonlinear' "
        "value='true'/></bsdf></shape>"
        "<shape type='rectangle'><bsdf type='roughplastic'><float name='alpha' value='0.2'/><rgb "
        "name='diffuse_reflectance' value='0.1'/></bsdf></shape>");
    REQUIRE(s.bsdfs.size() == 2);
    const auto first = parameters<RoughPlastic>(s.bsdfs[0]), second = parameters<RoughPlastic>(s.bsdfs[1]);
    CHECK(first.nonlinear == 1);
    REQUIRE(first.transmittance_table != kNone);
    CHECK(first.transmittance_table == second.transmittance_table);  // the same boundary
    std::vector<float> table(kTransmittanceTableSize);
    rough_transmittance_table(Microfacets::beckmann, 0.2f, first.ior, table.data());
    CHECK(std::equal(table.begin(), table.end(), s.tables.begin() + first.transmittance_table));
    CHECK(second.fdr_internal == rough_internal_reflectance(Microfacets::beckmann, 0.2f, second.ior));
    CHECK(second.specular_sampling_weight == Approx(1 / 1.1));
}

TEST_CASE("adapters flatten into materials") {
    const test::TempFolder folder;
    folder.write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}));
    const auto texture = [](const std::string& name) {
        return "<texture type='bitmap' " + name +
               "><string name='filename' value='t.png'/><boolean name='raw' value='true'/></texture>";
    };
    const auto material = [&](const std::string& xml) {
        const Scene s = load("<shape type='rectangle'>" + xml + "</shape>", {}, "3.0.0", &folder);
        return std::pair{s.materials[s.shapes[0].material], s};
    };
    {
        const auto [m, s] = material("<bsdf type='twosided'><bsdf type='diffuse'/></bsdf>");
        CHECK(m.two_sided);
        CHECK(m.front == m.back);
        CHECK(m.opacity.value == 1.0f);
        CHECK_FALSE(s.features.opacity);
    }
    {
        const auto [m, s] = material(
            "<bsdf type='twosided'><bsdf type='diffuse' name='front'/><bsdf type='plastic' name='back'/></bsdf>");
        CHECK(s.bsdfs[m.front].type == BsdfType::diffuse);
        CHECK(s.bsdfs[m.back].type == BsdfType::plastic);
    }
    {
        const auto [m, s] =
            material("<bsdf type='mask'>" + texture("name='opacity'") + "<bsdf type='twosided'><bsdf type='bumpmap'>" +
                     texture("") + "<float name='scale' value='3'/><bsdf type='conductor'/></bsdf></bsdf></bsdf>");
        CHECK(m.opacity.texture == 0);
        CHECK(m.two_sided);
        CHECK(s.bsdfs[m.front].type == BsdfType::conductor);
        CHECK(s.bsdfs[m.front].bump_map == 0);
        CHECK(s.bsdfs[m.front].bump_scale == 3.0f);
        CHECK(s.textures.size() == 1);  // the same file with the same settings
        CHECK(s.features.opacity);
        CHECK(s.features.bumps);
    }
    {
        const auto [m, s] =
            material("<bsdf type='normalmap'>" + texture("name='normalmap'") +
                     "<bsdf type='mask'><float name='opacity' value='0.25'/><bsdf type='dielectric'/></bsdf></bsdf>");
        CHECK(m.opacity.value == 0.25f);
        CHECK_FALSE(m.two_sided);
        CHECK(s.bsdfs[m.front].normal_map == 0);
    }
    CHECK(contains(error_of("<shape type='rectangle'><bsdf type='twosided'><bsdf type='dielectric'/></bsdf></shape>"),
                   "cannot be inside of twosided"));
    CHECK(contains(error_of("<shape type='rectangle'><bsdf type='twosided'/></shape>"), "twosided has no nested BSDF"));
    CHECK(contains(error_of("<shape type='rectangle'><bsdf type='mask'><float name='opacity' value='2'/><bsdf "
                            "type='diffuse'/></bsdf></shape>"),
                   "opacity must lie between 0 and 1"));
}

TEST_CASE("spectra become colours as in Mitsuba's RGB mode") {
    const auto emission = [](const std::string& list) {
        return load("<emitter type='constant'><spectrum name='radiance' value='" + list + "'/></emitter>")
            .emitters[0]
            .radiance.value;
    };
    check_rgb(emission("400:0, 500:8, 600:15.6, 700:18.4"), {20.7108f, 10.8546f, 2.77115f}, 2e-3);  // all from Mitsuba
    check_rgb(emission("400:1, 700:1"), {1.19969f, 0.94952f, 0.903443f}, 2e-4);
    check_rgb(emission("360:1 830:1"), {1.20488f, 0.948228f, 0.909267f}, 2e-4);
    check_rgb(emission("2.5"), {3.01198f, 2.37073f, 2.27229f}, 1e-4);
    const auto reflectance = [](const std::string& list) {
        return parameters<Diffuse>(
                   bsdf("<bsdf type='diffuse'><spectrum name='reflectance' value='" + list + "'/></bsdf>"))
            .reflectance.value;
    };
    check_rgb(reflectance("400:0.78, 500:0.78, 600:0.78, 700:0.78"), {0.776367f, 0.77981f, 0.776029f}, 2e-4);
    check_rgb(reflectance("400:0.1, 500:0.3, 600:0.6, 700:0.9"), {0.726577f, 0.424956f, 0.17397f}, 2e-4);
    check_rgb(reflectance("450:1.5, 650:.2"), {0.138936f, 0.993237f, 0.760334f}, 2e-4);
    const auto diffuse_color = [](const std::string& value, const char* version) {
        return parameters<Diffuse>(bsdf("<bsdf type='diffuse'>" + value + "</bsdf>", version)).reflectance.value;
    };
    check_rgb(diffuse_color("<rgb name='reflectance' value='#ff8000'/>", "3.0.0"), {1, 128 / 255.0f, 0});
    check_rgb(diffuse_color("<srgb name='reflectance' value='#ff8000'/>", "0.6.0"), {1, 0.2158605f, 0}, 1e-5);
}

TEST_CASE("textures: top row at t = 0, decoding, pooling, transforms") {
    const test::TempFolder folder;
    // Top row red and green, bottom row blue and grey 188 (linear 0.5).
    folder.write("t.png", png_bytes(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 188, 188, 188}));
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
    const auto diffuse = [](const std::string& extra) {
        return "<shape type='obj'><string name='filename' value='m.obj'/><bsdf type='diffuse'><texture "
               "name='reflectance' type='bitmap'><string name='filename' value='t.png'/>" +
               extra + "</texture></bsdf></shape>";
    };
    const Scene s =
        load(diffuse("") + diffuse("") + diffuse("<boolean name='raw' value='true'/>") +
                 diffuse("<string name='wrap_mode' value='clamp'/><string name='filter_type' value='nearest'/>"),
             {}, "3.0.0", &folder);
    REQUIRE(s.textures.size() == 3);
    CHECK(s.texels.size() == 16);  // one copy of the pixels
    CHECK(parameters<Diffuse>(s.bsdfs[0]).reflectance.texture == parameters<Diffuse>(s.bsdfs[1]).reflectance.texture);
    for (const Texture& t : s.textures) CHECK(t.offset % 16 == 0);
    CHECK(int(s.texels[0]) == 255);  // red at row 0
    CHECK(int(s.texels[12]) == 188);
    CHECK(s.tables[s.textures[0].decode_table + 188] == Approx(0.502886).epsilon(1e-4));
    CHECK(s.tables[s.textures[0].decode_table + 255] == 1.0f);
    CHECK(s.tables[s.textures[1].decode_table + 51] == Approx(0.2));
    CHECK(s.textures[0].wrap == WrapMode::repeat);
    CHECK(s.textures[0].filter == TextureFilter::bilinear);
    CHECK(s.textures[2].wrap == WrapMode::clamp);
    CHECK(s.textures[2].filter == TextureFilter::nearest);
    // OBJ puts v = 1 at the top: (0,1) of the file must see the top left texel.
    CHECK(s.vertices[0].uv().y == 1.0f);
    CHECK(s.vertices[2].uv().y == 0.0f);
    // The older generation's names, and gamma 1 = raw.
    const Scene old = load(
        "<shape type='rectangle'><bsdf type='diffuse'><texture name='reflectance' type='bitmap'><string "
        "name='filename' value='t.png'/><float name='gamma' value='1'/>"
        "<float name='uscale' value='2'/><float name='voffset' value='0.5'/><string name='filterType' "
        "value='trilinear'/><string name='wrapMode' value='mirror'/></texture></bsdf></shape><emitter "
        "type='constant'/>",
        {}, "0.6.0", &folder);
    CHECK(old.tables[old.textures[0].decode_table + 51] == Approx(0.2));
    CHECK(old.textures[0].to_uv[0][0] == 2.0f);
    CHECK(old.textures[0].to_uv[1][2] == 0.5f);
    CHECK(old.textures[0].wrap == WrapMode::mirror);
    CHECK(old.vertices[2].v == 1.0f);  // rectangle: as it is

    const Scene checker = load(
        "<shape type='rectangle'><bsdf type='diffuse'><texture name='reflectance' type='checkerboard'><rgb "
        "name='color0' value='0.7'/>"
        "<transform name='to_uv'><scale x='20' y='80'/><translate x='0.5'/></transform></texture></bsdf></shape>");
    const Texture& t = checker.textures[0];
    CHECK(t.type == TextureType::checkerboard);
    CHECK(t.color0 == splat(0.7f));
    CHECK(t.color1 == splat(0.2f));
    CHECK(t.to_uv[0][0] == 20.0f);
    CHECK(t.to_uv[1][1] == 80.0f);
    CHECK(t.to_uv[0][2] == 0.5f);
    CHECK(checker.features.textures);
}
