// libs: ambilux_formats
// timeout: 60
// Lights of pbrt scenes, and colours.
#include <cmath>

#include "formats/images/image_write.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"
#include "transport/emitter/envmap.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("colours: spaces, black bodies, spectra and what lights make of them") {
    const auto light = [](const std::string& parameters, const std::string& before = "") {
        const Scene s = load_pbrt_world(before + "LightSource \"point\" " + parameters);
        return s.emitters[0].radiance.value;
    };
    check_rgb(light("\"rgb I\" [1 2 3] \"float scale\" 2"), {2, 4, 6});
    CHECK(luminance(light("\"blackbody I\" 3000 \"float scale\" 5")) == Approx(5));
    CHECK(luminance(light("\"spectrum I\" [300 7 900 7]")) == Approx(1));
    check_rgb(light("\"spectrum I\" \"stdillum-D65\""), splat(1));
    // Fluorescent lamps: F7 is daylight, F12 warm; both of luminance 1.
    check_rgb(light("\"spectrum I\" \"stdillum-F7\""), splat(1), 5e-3);
    const Rgb f12 = light("\"spectrum I\" \"stdillum-F12\"");
    CHECK(luminance(f12) == Approx(1).epsilon(1e-4));
    CHECK(f12.x > 1.3);
    CHECK(f12.z < 0.4);
    CHECK(contains(pbrt_error("WorldBegin LightSource \"point\" \"spectrum I\" \"stdillum-F13\""),
                   "known by the name 'stdillum-F13'"));
    const Rgb warm = light("\"blackbody I\" 3000");
    CHECK(warm.x > warm.y);
    CHECK(warm.y > warm.z);
    // White stays white, and the red of a wider gamut is redder than ours (ITU-R BT.2087).
    check_rgb(light("\"rgb I\" [1 1 1]", "ColorSpace \"rec2020\" "), splat(1), 1e-4);
    check_rgb(light("\"rgb I\" [1 1 1]", "ColorSpace \"dci-p3\" "), splat(1), 1e-4);
    check_rgb(light("\"rgb I\" [1 0 0]", "ColorSpace \"rec2020\" "), {1.6605f, 0, 0}, 1e-3);
    const Rgb half = light("\"rgb I\" [1 .5 .25]", "ColorSpace \"dci-p3\" ");
    check_rgb(half, {1.1125f, 0.4790f, 0.2155f}, 2e-3);
    CHECK(light("\"float power\" 10").x == Approx(10 / (4 * M_PI)));
}

TEST_CASE("the film's exposure scales lights") {
    const auto value = [](const std::string& options) {
        return load_pbrt_text(options + " WorldBegin LightSource \"distant\"").emitters[0].radiance.value.x;
    };
    CHECK(value("") == 1);
    CHECK(value("Film \"rgb\" \"float iso\" 200") == 2);
    CHECK(value("Film \"rgb\" \"float iso\" 200 Camera \"perspective\" \"float shutterclose\" .25") == 0.5f);
}

TEST_CASE("environment maps keep their directions") {
    const TempFolder folder;
    constexpr int n = 64;
    // A direction's colour says where it points. The inverse of the equal-area octahedral map (Clarberg 2008), as an
    // area-preserving map by its cells: found by search, apart from the reader's formula.
    std::vector<float> texels;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const double u = 2 * (x + 0.5) / n - 1, v = 2 * (y + 0.5) / n - 1, d = 1 - std::fabs(u) - std::fabs(v);
            const double r = 1 - std::fabs(d), z = d < 0 ? -(1 - r * r) : 1 - r * r;
            const double phi = ((std::fabs(v) - std::fabs(u)) / r + 1) * M_PI / 4, sine = std::sqrt(1 - z * z);
            for (double c : {std::copysign(std::cos(phi), u) * sine, std::copysign(std::sin(phi), v) * sine, z})
                texels.push_back(float(c + 1));
        }
    write_float_image(folder / "e.exr", n, n, texels);
    const Scene s = load_pbrt_world(
        "Rotate 90 0 0 1 LightSource \"infinite\" \"string filename\" \"e.exr\" \"float scale\" 2", {}, &folder);
    const Emitter& e = s.emitters[0];
    for (const Vec3f d : {Vec3f{1, 2, 3}, Vec3f{-3, 1, 1}, Vec3f{0.1f, -1, 0.2f}, Vec3f{1, 1, -4}, Vec3f{-1, -2, -1}}) {
        const Vec3f w = normalize(d);
        // What shines from the light's x is seen along the world's y.
        const Vec3f local = {w.y, -w.x, w.z};
        check_rgb(envmap_radiance(s.view(), e, w), (local + splat(1)) * 2, 0.1);
    }
}

TEST_CASE("several infinite lights are one") {
    const TempFolder folder;
    write_float_image(folder / "sky.exr", 4, 4, std::vector<float>(48, 2.0f));
    const std::string map = "LightSource \"infinite\" \"string filename\" \"sky.exr\" \"float scale\" 0.5 ",
                      constant = "LightSource \"infinite\" \"rgb L\" [0.25 0.5 0.75] ";
    const Scene two = load_pbrt_world(constant + constant, {}, &folder);
    REQUIRE(two.emitters.size() == 1);
    check_rgb(two.emitters[0].radiance.value, {0.5f, 1, 1.5f});
    for (const std::string& lights : {map + constant, constant + map}) {
        const Scene s = load_pbrt_world(lights, {}, &folder);
        REQUIRE(s.emitters.size() == 1);
        CHECK(s.emitters[0].type == EmitterType::envmap);
        const Rgb texel = load_texel(s.view(), s.textures[size_t(s.emitters[0].radiance.texture)], 1, 1);
        check_rgb(s.emitters[0].radiance.value * texel, {1.25f, 1.5f, 1.75f}, 1e-3);
    }
    CHECK(contains(pbrt_error("WorldBegin " + map + map, {}, &folder), "two infinite lights with images"));
}

TEST_CASE("a light of alpha 0 shines unseen; what is no light is gone") {
    const auto load = [](const std::string& alpha, const std::string& light) {
        return load_pbrt_world(light + "Shape \"sphere\" " + alpha);
    };
    const std::string light = "AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] ";
    const auto type = [](const Scene& s) { return s.emitters.at(0).type; };
    const auto opacity = [](const Scene& s) { return s.materials[s.shapes[0].material].opacity.value; };
    const Scene unseen = load("\"float alpha\" 0", light), seen = load("\"float alpha\" .5", light);
    CHECK(type(unseen) == EmitterType::hidden_area);
    CHECK(opacity(unseen) == 0);
    CHECK(unseen.emitters[0].radiance.value == load("", light).emitters[0].radiance.value);
    CHECK(unseen.emitters[0].pick_probability == 1);
    CHECK(type(seen) == EmitterType::area);
    CHECK(opacity(seen) == 0.5f);
    const Scene none = load("\"float alpha\" 0", "");
    CHECK(none.emitters.empty());
    CHECK(opacity(none) == 0);
    // From a texture too, of a mesh, to both sides.
    const Scene s = load_pbrt_world(
        "Texture \"zero\" \"float\" \"constant\" \"float value\" 0\n"
        "AreaLightSource \"diffuse\" \"bool twosided\" true Material \"dielectric\" "
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] \"texture alpha\" "
        "\"zero\"");
    REQUIRE(s.emitters.size() == 2);
    for (const Emitter& e : s.emitters) CHECK(e.type == EmitterType::hidden_area);
}

TEST_CASE("alpha covers what a light emits, too") {
    const auto load = [](const std::string& before, const std::string& alpha,
                         const std::string& L = "\"rgb L\" [1 2 3]") {
        return load_pbrt_world(before + "AreaLightSource \"diffuse\" " + L +
                               " Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] " +
                               "\"point2 uv\" [0 0 4 0 0 4] " + alpha);
    };
    const ParamRgb full = load("", "").emitters.at(0).radiance;
    CHECK(load("", "\"float alpha\" .25").emitters.at(0).radiance.value == full.value * 0.25f);
    CHECK(load("", "\"float alpha\" 3").emitters.at(0).radiance.value == full.value);
    const Scene s = load("Texture \"m\" \"float\" \"checkerboard\" \"float tex1\" 1 \"float tex2\" .5\n",
                         "\"texture alpha\" \"m\"");
    const Emitter& e = s.emitters.at(0);
    REQUIRE(e.radiance.texture >= 0);
    const auto at = [&](float u, float v) { return eval_rgb<kAllFeatures>(s.view(), e.radiance, {u, v}); };
    CHECK(max_component(abs(at(0.5f, 0.5f) - full.value)) < 1e-3f);
    CHECK(max_component(abs(at(1.5f, 0.5f) - full.value * 0.5f)) < 1e-3f);
}
