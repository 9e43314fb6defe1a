// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// Layers of surfaces: known values on plain scenes, and what lies behind glass and mirrors.
#include "render/aov.h"

#include "tests/support/render_scene.h"

namespace ambilux {
namespace {

/// A square of albedo (0.2, 0.5, 0.8) two units before the camera, and `before` between them.
Scene square(const test::TempFolder& folder, const std::string& before) {
    folder.write("s.xml", R"(<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="20"/>
<transform name="to_world"><lookat origin="0,0,2" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="4"/><rfilter type="box"/></film></sensor>
<emitter type="constant"/>
<shape type="rectangle"><bsdf type="diffuse"><rgb name="reflectance" value="0.2, 0.5, 0.8"/></bsdf></shape>)" +
                              before + "</scene>");
    return load_mitsuba(folder / "s.xml");
}

const Layer& layer_of(const std::vector<Layer>& layers, const std::string& name) {
    for (const Layer& layer : layers)
        if (layer.name == name) return layer;
    FAIL("no layer " << name);
    return layers[0];
}

/// Mean over pixels of a channel.
double mean(const Layer& layer, size_t channel) {
    double sum = 0;
    for (size_t i = channel; i < layer.values.size(); i += layer.channels.size()) sum += layer.values[i];
    return sum * double(layer.channels.size()) / double(layer.values.size());
}

}  // namespace

TEST_CASE("layers of a plain surface are its reflectance, normal, distance and place") {
    const test::TempFolder folder;
    const Scene scene = square(folder, "");
    const auto layers = sample_aovs(scene, {}, 32);
    REQUIRE(layers.size() == aov_names().size());
    const Layer &albedo = layer_of(layers, "albedo"), &normal = layer_of(layers, "normal"),
                &position = layer_of(layers, "position"), &depth = layer_of(layers, "depth");
    CHECK(mean(albedo, 0) == Approx(0.2));
    CHECK(mean(albedo, 2) == Approx(0.8));
    CHECK(mean(normal, 2) == Approx(1));
    CHECK(depth.values.size() == 32);
    // The middle of the image is at 2, its corners farther.
    CHECK(depth.values[8 + 4] == Approx(2).margin(0.02));
    CHECK(depth.values[0] > depth.values[12]);
    CHECK(std::abs(mean(position, 2)) < 1e-5);
    // x grows to the right, y upwards.
    CHECK(position.values[0] < -0.2);
    CHECK(position.values[1] > 0.05);
}

TEST_CASE("layers of a spherical sensor lie all around it") {
    const test::TempFolder folder;
    folder.write("s.xml", R"(<scene version="3.0.0">
<sensor type="spherical"><film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="4"/>
<rfilter type="box"/></film></sensor>
<shape type="sphere"><float name="radius" value="2"/><boolean name="flip_normals" value="true"/><emitter type="area"/></shape>
</scene>)");
    const auto layers = sample_aovs(load_mitsuba(folder / "s.xml"), {}, 32);
    const Layer &depth = layer_of(layers, "depth"), &position = layer_of(layers, "position");
    for (const float d : depth.values) CHECK(d == Approx(2).epsilon(1e-5));
    for (uint32_t y = 0; y < 4; ++y)
        for (uint32_t x = 0; x < 8; ++x) {
            CAPTURE(x, y);
            const float* p = &position.values[(y * 8 + x) * 3];
            CHECK((p[0] > 0) == (x < 4));
            CHECK((p[1] > 0) == (y < 2));
            CHECK((p[2] > 0) == (x >= 2 && x < 6));
        }
}

TEST_CASE("albedo and normal are those behind glass and in mirrors, depth is that of the glass") {
    const test::TempFolder folder;
    const std::string slab = R"(<shape type="cube"><transform name="to_world"><scale x="3" y="3" z="0.1"/>
<translate z="1"/></transform><bsdf type="dielectric"><float name="int_ior" value="1.5"/></bsdf></shape>)";
    const Scene scene = square(folder, slab);
    const auto layers = sample_aovs(scene, {}, 4000);
    // Of light that meets the slab at normal incidence two faces reflect r = 0.04 each: 2r/(1+r) in all (Hecht,
    // section 4.6), and what they reflect meets the sky, whose albedo is 0.
    const double through = 1 - 2 * 0.04 / 1.04;
    const Layer& albedo = layer_of(layers, "albedo");
    CHECK(mean(albedo, 1) == Approx(0.5 * through).epsilon(0.01));
    CHECK(mean(layer_of(layers, "normal"), 2) == Approx(through).epsilon(0.01));
    CHECK(layer_of(layers, "depth").values[12] == Approx(0.9).margin(0.01));
    for (const float v : albedo.values) CHECK((v >= 0 && v <= 1));

    const std::string mirror = R"(<shape type="rectangle"><transform name="to_world"><translate z="0.5"/></transform>
<bsdf type="conductor"><string name="material" value="none"/><rgb name="specular_reflectance" value="0.5"/></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate y="1" angle="180"/><translate z="3"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.4"/></bsdf></shape>)";
    const auto seen = sample_aovs(square(folder, mirror), {}, 16);
    CHECK(mean(layer_of(seen, "albedo"), 0) == Approx(0.2));
    CHECK(mean(layer_of(seen, "normal"), 2) == Approx(-1));
}

TEST_CASE("albedo inside of glass is that of the surface there, less what the way in reflects") {
    const test::TempFolder folder;
    const Scene scene = square(folder, R"(<shape type="cube"><transform name="to_world"><scale x="3" y="3" z="1"/>
</transform><bsdf type="dielectric"><float name="int_ior" value="1.5"/></bsdf></shape>)");
    const auto layers = sample_aovs(scene, {}, 4000);
    const double through = 1 - 0.04;
    CHECK(mean(layer_of(layers, "albedo"), 0) == Approx(0.2 * through).epsilon(0.01));
    CHECK(mean(layer_of(layers, "albedo"), 1) == Approx(0.5 * through).epsilon(0.01));
    CHECK(mean(layer_of(layers, "normal"), 2) == Approx(through).epsilon(0.01));
    CHECK(layer_of(layers, "depth").values[12] == Approx(1).margin(0.01));
}

TEST_CASE("what sees nothing is 0") {
    const test::TempFolder folder;
    folder.write("s.xml", R"(<scene version="3.0.0"><sensor type="perspective">
<film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/></film></sensor>
<emitter type="constant"/><shape type="sphere"><point name="center" z="-9"/></shape></scene>)");
    for (const Layer& layer : sample_aovs(load_mitsuba(folder / "s.xml"), {}, 4))
        for (const float v : layer.values) CHECK(v == 0);
}

}  // namespace ambilux
