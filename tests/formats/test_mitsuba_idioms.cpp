// libs: ambilux_formats ambilux_accel PNG::PNG JPEG::JPEG
// timeout: 120
// What scene collections and exporters write: each idiom loads, with the image that the file asks for, and what is done
// in another way than the file says is noted.
#include <algorithm>
#include <cmath>

#include "core/math.h"
#include "formats/meshes/mesh.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "transport/blend.h"
#include "transport/texture.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

bool has_note(const Scene& s, const std::string& part) {
    return std::any_of(s.notes.begin(), s.notes.end(), [&](const std::string& n) { return contains(n, part); });
}

Scene load_quietly(const std::string& body, const std::string& version = "3.0.0", const TempFolder* folder = nullptr) {
    INFO(body);
    const Scene s = load(body, {}, version, folder);
    CHECK(s.warnings.empty());
    return s;
}

std::string film(const std::string& xml) { return "<sensor type='perspective'>" + xml + "</sensor>"; }

Rgb reflectance(const Scene& s, size_t shape, Vec2f uv) {
    const BsdfRecord& record = s.bsdfs[s.materials[s.shapes[shape].material].front];
    return eval_rgb<kAllFeatures>(s.view(), record.as<Diffuse>().reflectance, uv);
}

std::string textured(const std::string& texture) {
    return "<shape type='rectangle'><bsdf type='diffuse'>" + texture + "</bsdf></shape>";
}

void check_rgb(Rgb a, Rgb b, double tolerance = 1e-5) {
    for (int i = 0; i < 3; ++i) CHECK(a[i] == Approx(b[i]).margin(tolerance));
}

}  // namespace

TEST_CASE("films: all kinds get linear values, with a note") {
    for (const char* type : {"ldrfilm", "tiledhdrfilm", "mfilm"}) {
        const Scene s = load_quietly(film("<film type='" + std::string(type) +
                                          "'><integer name='width' value='64'/><integer name='height' value='32'/>"
                                          "<float name='gamma' value='2.2'/><boolean name='banner' value='false'/>"
                                          "<string name='fileFormat' value='png'/><rfilter type='box'/></film>"),
                                     "0.6.0");
        CHECK(s.sensor.film_width == 64);
        CHECK(s.sensor.filter == FilterType::box);
        CHECK(has_note(s, "a film of type '" + std::string(type) + "' gets linear values"));
    }
    CHECK(contains(error_of(film("<film type='specfilm'/>")), "film type 'specfilm' is not supported"));
}

TEST_CASE("filters with negative lobes become a gaussian, samplers independent, with a note") {
    for (const char* type : {"mitchell", "catmullrom", "lanczos"}) {
        const Scene s = load_quietly(film("<film type='hdrfilm'><rfilter type='" + std::string(type) + "'/></film>"));
        CHECK(s.sensor.filter == FilterType::gaussian);
        CHECK(s.sensor.filter_radius == 2);
        CHECK(has_note(s, "has negative lobes"));
    }
    const Scene s =
        load_quietly(film("<sampler type='blue'><integer name='sample_count' value='9'/><float "
                          "name='radius' value='1'/></sampler>"));
    CHECK(s.integrator.spp == 9);
    CHECK(has_note(s, "sampler type 'blue' is not known"));
}

TEST_CASE("integrators of the same equation are the path tracer") {
    for (const char* type : {"volpath", "volpath_simple", "volpathmis", "pssmlt", "mlt", "erpt", "photonmapper", "ppm",
                             "sppm", "vpl", "prb"}) {
        const Scene s = load_quietly("<integrator type='" + std::string(type) +
                                         "'><integer name='maxDepth' value='7'/><integer name='workUnits' value='3'/>"
                                         "</integrator>",
                                     "0.5.0");
        CHECK(s.integrator.type == "path");
        CHECK(s.integrator.max_depth == 7);
        CHECK(has_note(s, "has the image of the path tracer"));
    }
    for (const char* type : {"aov", "multichannel", "adaptive", "irrcache"}) {
        const Scene s = load_quietly("<integrator type='" + std::string(type) +
                                     "'><string name='aovs' value='dd:depth'/><integrator type='path'><integer "
                                     "name='max_depth' value='5'/></integrator></integrator>");
        CHECK(s.integrator.max_depth == 5);
    }
    CHECK(load_quietly("<integrator type='ptracer'/>").integrator.type == "light");
    CHECK(contains(error_of("<integrator type='aov'/>"), "aov has no nested integrator"));
}

TEST_CASE("several sensors: the first one") {
    const Scene s = load_quietly(
        "<sensor type='perspective'/><sensor type='thinlens'/><film type='hdrfilm' id='f'/>"
        "<sampler type='independent' id='s'/>");
    CHECK(s.sensor.type == SensorType::perspective);
    CHECK(has_note(s, "the first of several sensors"));
}

TEST_CASE("format 0.3 and 0.5: old names of elements, attributes for intent, lookAt without up") {
    const Scene s = load_quietly(
        "<camera type='perspective'><transform name='toWorld'><lookAt origin='0,0,5' target='0,0,0'/></transform>"
        "</camera><luminaire type='point'><spectrum name='intensity' value='3' intent='illuminant'/></luminaire>"
        "<sensor type='perspective'/>",
        "0.3.0");
    REQUIRE(s.emitters.size() == 1);
    check_rgb(s.emitters[0].radiance.value, splat(3));
    CHECK(s.sensor.to_world.m[2][3] == 5);
    CHECK(s.sensor.to_world.m[2][2] == -1);
}

TEST_CASE("spectra that are objects, and black bodies") {
    const auto intensity = [](const std::string& xml, const std::string& version = "3.0.0") {
        return load_quietly("<emitter type='point'>" + xml + "</emitter>", version).emitters[0].radiance.value;
    };
    check_rgb(intensity("<spectrum name='intensity' type='d65'><float name='scale' value='4'/></spectrum>"), splat(4));
    check_rgb(intensity("<spectrum name='intensity' type='uniform'><float name='value' value='2'/></spectrum>"),
              splat(2));
    check_rgb(
        intensity("<spectrum name='intensity' type='rawconstant'><vector name='value' value='1,2,3'/></spectrum>"),
        {1, 2, 3});
    const Rgb list = intensity("<spectrum name='intensity' value='400:1, 500:3, 700:2'/>");
    check_rgb(intensity("<spectrum name='intensity' type='irregular'><string name='wavelengths' value='400,500,700'/>"
                        "<string name='values' value='1,3,2'/></spectrum>"),
              list);
    check_rgb(intensity("<spectrum name='intensity' type='regular'><float name='wavelength_min' value='400'/><float "
                        "name='wavelength_max' value='600'/><string name='values' value='1 3 2'/></spectrum>"),
              intensity("<spectrum name='intensity' value='400:1, 500:3, 600:2'/>"));
    // At 6500 K a black body is nearly white; that of format 3 and that of 0.6 are one.
    const Rgb hot = intensity("<blackbody name='intensity' temperature='6500K' scale='2'/>", "0.6.0");
    CHECK(hot.x / hot.z == Approx(1).margin(0.1));
    check_rgb(hot / hot.y, intensity("<spectrum name='intensity' type='blackbody'><float name='temperature' "
                                     "value='6500'/></spectrum>") *
                               (2 / hot.y));
    CHECK(contains(error_of("<emitter type='point'><spectrum name='intensity' type='led'/></emitter>"),
                   ":2: spectrum type 'led' is not supported"));
    CHECK(contains(error_of("<emitter type='point'><spectrum name='intensity' type='d65'><float name='k' "
                            "value='1'/></spectrum></emitter>"),
                   "unknown parameter 'k' of a spectrum"));
}

TEST_CASE("textures: scale, rawconstant, gridtexture, channel") {
    const TempFolder folder;
    folder.write("i.png", png_file(1, 1, {255, 0, 128}));
    const std::string image = "<string name='filename' value='i.png'/>";
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='scale'><rgb name='scale' value='"
                                                "0.5,1,0.25'/><texture type='scale'><float name='scale' value='0.5'/>"
                                                "<texture type='bitmap'>" +
                                                image + "</texture></texture></texture>"),
                                       "0.6.0", &folder),
                          0, {0.5f, 0.5f}),
              {0.25f, 0, 0.125f * 0.2158605f});
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='bitmap'><string name='channel' "
                                                "value='r'/>" +
                                                image + "</texture>"),
                                       "0.6.0", &folder),
                          0, {0.5f, 0.5f}),
              splat(1));
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='bitmap'><string name='channel' "
                                                "value='a'/>" +
                                                image + "</texture>"),
                                       "0.6.0", &folder),
                          0, {0.5f, 0.5f}),
              splat(1));
    check_rgb(reflectance(load_quietly(textured("<texture name='reflectance' type='rawconstant'><rgb name='value' "
                                                "value='0.1,0.2,0.3'/></texture>")),
                          0, {0.3f, 0.6f}),
              {0.1f, 0.2f, 0.3f});
    const Scene grid = load_quietly(textured("<texture name='reflectance' type='gridtexture'><float name='lineWidth' "
                                             "value='0.05'/><float name='uscale' value='2'/></texture>"),
                                    "0.6.0");
    for (const auto& [u, expected] : {std::pair{0.02f, 0.4f}, {0.03f, 0.2f}, {0.47f, 0.2f}, {0.48f, 0.4f}})
        check_rgb(reflectance(grid, 0, {u, 0.5f}), splat(expected));
    check_rgb(reflectance(grid, 0, {0.25f, 0.96f}), splat(0.4f));
    CHECK(contains(error_of(textured("<texture name='reflectance' type='scale'/>")), "has no nested texture"));
}

TEST_CASE("null is a surface that rays do not see, unless it emits") {
    const Scene s = load_quietly(
        "<shape type='sphere'><bsdf type='null'/></shape><shape type='rectangle'><bsdf "
        "type='null'/><emitter type='area'/></shape>");
    CHECK(s.materials[s.shapes[0].material].opacity.value == 0);
    const Material& pane = s.materials[s.shapes[1].material];
    CHECK(pane.opacity.value == 1);
    CHECK(s.bsdfs[pane.front].type == BsdfType::thin_dielectric);
    CHECK(s.bsdfs[pane.front].as<ThinDielectric>().ior == 1);
}

TEST_CASE("merge holds shapes; sampling weights are noted") {
    const Scene s = load_quietly(
        "<shape type='merge'><shape type='cube'/><shape type='rectangle'/></shape>\n"
        "<emitter type='point'><float name='sampling_weight' value='2'/></emitter>");
    CHECK(s.shapes.size() == 2);
    CHECK(has_note(s, "sampling weights of emitters"));
    CHECK(contains(error_of("<emitter type='point'><float name='sampling_weight' value='0'/></emitter>"),
                   "a sampling weight of 0"));
}

TEST_CASE("maxSmoothAngle divides vertices at sharp edges only") {
    // A roof of two slopes with 60 degrees between their normals.
    const TempFolder folder;
    const float c = std::cos(30 * kPi / 180), h = std::sin(30 * kPi / 180);
    std::string obj;
    for (const Vec3f p : {Vec3f{-c, -1, -h}, {-c, 1, -h}, {0, -1, 0}, {0, 1, 0}, {c, -1, -h}, {c, 1, -h}})
        obj += "v " + std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + "\n";
    folder.write("roof.obj", obj + "f 1 3 4 2\nf 3 5 6 4\n");
    const auto shape = [&](const char* angle) {
        return load_quietly(
            "<shape type='obj'><string name='filename' value='roof.obj'/><float name='maxSmoothAngle' "
            "value='" +
                std::string(angle) + "'/></shape>",
            "0.6.0", &folder);
    };
    const Scene sharp = shape("50"), smooth = shape("70");
    CHECK(sharp.vertices.size() == 8);
    CHECK(smooth.vertices.size() == 6);
    for (const MeshVertex& v : sharp.vertices) CHECK(std::fabs(v.n.x) == Approx(0.5).margin(1e-4));
    for (const MeshVertex& v : smooth.vertices)
        if (std::fabs(v.p.x) < 0.1f) CHECK(v.n.z == Approx(1).margin(1e-4));
    Mesh fan;
    for (uint32_t i = 0; i < 5000; ++i) {
        const float a = float(i) * 1e-3f;
        fan.positions.insert(fan.positions.end(), {{0, 0, 0}, {std::cos(a), std::sin(a), 0}, {0, 0, float(i + 1)}});
        fan.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    CHECK_THROWS_AS(split_at_edges("fan.obj", fan, 10), Error);
}

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
    CHECK(contains(refused("<bsdf type='blendbsdf'><bsdf type='mask'>" + red + "</bsdf>" + red + "</bsdf>"),
                   "a mask inside of a blend"));
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
