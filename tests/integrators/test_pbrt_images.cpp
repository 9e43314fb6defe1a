// libs: ambilux_render ambilux_integrators ambilux_film ambilux_convert ambilux_formats ambilux_accel JPEG::JPEG
// timeout: 200
// Images of pbrt scenes: lights and materials with closed forms, the same scene in Mitsuba's XML, and both after
// conversion.
#include "formats/convert/convert.h"
#include "formats/images/image_write.h"
#include "scene/info.h"
#include "scene/surface.h"
#include "tests/support/closed_forms.h"
#include "tests/support/image_files.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"

using namespace ambilux;
using test::load_pbrt_text;
using test::TempFolder;

namespace {

constexpr uint32_t kSize = 16;
constexpr Rgb kAlbedo = {0.5f, 0.7f, 0.3f};

/// A plane at z = 0 from above: [-1,1]², x to the right and y upwards.
std::string plane_under(const std::string& lights,
                        const std::string& material = "\"diffuse\" \"rgb reflectance\" [.5 .7 .3]",
                        const std::string& film = "") {
    return "Scale -1 1 1 LookAt 0 0 .1  0 0 0  0 1 0 Camera \"orthographic\" Film \"rgb\" \"integer xresolution\" 16 "
           "\"integer yresolution\" 16 " +
           film + " PixelFilter \"box\" Integrator \"path\" \"integer maxdepth\" 1 WorldBegin\n" + lights +
           "\nMaterial " + material +
           " Shape \"trianglemesh\" \"point3 P\" [-1.5 -1.5 0 1.5 -1.5 0 1.5 1.5 0 -1.5 1.5 0] \"integer indices\" [0 "
           "1 2 0 2 3]";
}

double plane_x(double film_x) { return -1 + 2 * film_x / kSize; }
double plane_y(double film_y) { return 1 - 2 * film_y / kSize; }

template <class Function>
void check_plane(const std::string& scene, Rgb color, Function irradiance, const TempFolder* folder = nullptr) {
    const Image expected =
        image_of(kSize, kSize, color, [&](double x, double y) { return irradiance(plane_x(x), plane_y(y)) / M_PI; });
    const Scene s = load_pbrt_text(scene, {}, folder);
    check_expectation(s, cpu_settings(s, Estimator::nee), expected);
}

/// Cosine over squared distance at (x,y,0) of a point above.
double from_point(double x, double y, double px, double py, double pz) {
    const double d2 = (px - x) * (px - x) + (py - y) * (py - y) + pz * pz;
    return pz / (d2 * std::sqrt(d2));
}

/// Both scenes with the same samples.
ZTestResult compared(const Scene& a, const Scene& b, uint32_t spp) {
    ZTestOptions options;
    options.block = 4;
    options.rounding = 1e-4;
    const auto film = [&](const Scene& s, uint64_t seed) {
        return to_estimate(render_scene(s, cpu_settings(s, Estimator::mis, seed), spp).film);
    };
    return z_test(film(a, 1), film(b, 2), options);
}

const std::string kPly =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float "
    "u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n-4 0 -4 0 0\n4 0 -4 1 "
    "0\n4 0 4 1 1\n-4 0 4 0 1\n3 0 2 1\n3 0 3 2\n";

const std::string kPbrt = R"(
Scale -1 1 1
LookAt 0 3 8  0 1 0  0 1 0
Camera "perspective" "float fov" 35
Film "rgb" "integer xresolution" 48 "integer yresolution" 32
PixelFilter "box"
Integrator "path" "integer maxdepth" 5
WorldBegin
LightSource "infinite" "rgb L" [.3 .4 .5]
AttributeBegin
AreaLightSource "diffuse" "rgb L" [9 8 6]
Translate 1 5 1
Shape "sphere" "float radius" .7
AttributeEnd
AttributeBegin
Texture "c" "spectrum" "checkerboard" "float uscale" 6 "float vscale" 6 "rgb tex1" [.8 .7 .6] "rgb tex2" [.2 .3 .4]
Material "diffuse" "texture reflectance" "c"
Shape "plymesh" "string filename" "floor.ply"
AttributeEnd
AttributeBegin
Translate -1.5 1 0
Material "coateddiffuse" "rgb reflectance" [.6 .2 .2] "float roughness" 0 "float thickness" 0 "integer maxdepth" 100
Shape "sphere"
AttributeEnd
AttributeBegin
Translate 1.2 .8 -.5
Material "conductor" "spectrum eta" "metal-Cu-eta" "spectrum k" "metal-Cu-k" "float roughness" .09
Shape "sphere" "float radius" .8
AttributeEnd
AttributeBegin
Translate .2 .5 1.5
Material "dielectric" "float eta" 1.4
Shape "sphere" "float radius" .5
AttributeEnd
)";

const std::string kXml = R"(<scene version='3.0.0'>
<integrator type='path'><integer name='max_depth' value='6'/></integrator>
<sensor type='perspective'><float name='fov' value='35'/><string name='fov_axis' value='smaller'/>
<transform name='to_world'><lookat origin='0,3,8' target='0,1,0' up='0,1,0'/></transform>
<film type='hdrfilm'><integer name='width' value='48'/><integer name='height' value='32'/><rfilter type='box'/></film></sensor>
<emitter type='constant'><rgb name='radiance' value='.3 .4 .5'/></emitter>
<shape type='sphere'><point name='center' x='1' y='5' z='1'/><float name='radius' value='.7'/>
<bsdf type='diffuse'><rgb name='reflectance' value='.5'/></bsdf>
<emitter type='area'><rgb name='radiance' value='9 8 6'/></emitter></shape>
<shape type='ply'><string name='filename' value='floor.ply'/><boolean name='face_normals' value='true'/>
<bsdf type='twosided'><bsdf type='diffuse'><texture type='checkerboard' name='reflectance'>
<rgb name='color0' value='.8 .7 .6'/><rgb name='color1' value='.2 .3 .4'/>
<transform name='to_uv'><scale x='3' y='3'/></transform></texture></bsdf></bsdf></shape>
<shape type='sphere'><point name='center' x='-1.5' y='1' z='0'/><bsdf type='plastic'><rgb name='diffuse_reflectance' value='.6 .2 .2'/>
<float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/><boolean name='nonlinear' value='true'/></bsdf></shape>
<shape type='sphere'><point name='center' x='1.2' y='.8' z='-.5'/><float name='radius' value='.8'/>
<bsdf type='roughconductor'><string name='material' value='Cu'/><string name='distribution' value='ggx'/><float name='alpha' value='.3'/></bsdf></shape>
<shape type='sphere'><point name='center' x='.2' y='.5' z='1.5'/><float name='radius' value='.5'/>
<bsdf type='dielectric'><float name='int_ior' value='1.4'/><float name='ext_ior' value='1'/></bsdf></shape>
</scene>)";

/// The scene and what the converter writes of it have the same features and the same samples, up to the rounding of
/// transforms. What the converter notes.
std::vector<std::string> check_converted(const Scene& scene, const std::string& path, uint32_t spp = 16) {
    const std::vector<std::string> notes = write_mitsuba(scene, path);
    const Scene again = load_mitsuba(path);
    CHECK(again.warnings.empty());
    CHECK(feature_names(again.features) == feature_names(scene.features));
    CHECK(again.triangles.size() == scene.triangles.size());
    CHECK(again.emitters.size() == scene.emitters.size());
    const auto film = [&](const Scene& s) { return render_scene(s, cpu_settings(s, Estimator::mis), spp).film; };
    const FilmMoments a = film(scene), b = film(again);
    double difference = 0, sum = 0;
    for (size_t i = 0; i < a.sum.size(); ++i) difference += std::abs(a.mean(i) - b.mean(i)), sum += a.mean(i);
    CHECK(sum > 0);
    CHECK(difference < 1e-4 * sum);
    return notes;
}

}  // namespace

TEST_CASE("point lights: intensity, power, scale, exposure") {
    const auto e = [](double x, double y) { return from_point(x, y, 0.3, -0.2, 1.5); };
    const std::string from = " \"point3 from\" [.3 -.2 1.5]";
    check_plane(plane_under("LightSource \"point\" \"rgb I\" [2 3 4]" + from), kAlbedo * Rgb{2, 3, 4}, e);
    check_plane(plane_under("LightSource \"point\" \"float power\" 50" + from), kAlbedo * float(50 / (4 * M_PI)), e);
    check_plane(
        plane_under("Translate .3 -.2 0 LightSource \"point\" \"float scale\" 3 \"point3 from\" [0 0 1.5] Identity",
                    "\"diffuse\" \"rgb reflectance\" [.5 .7 .3]", "\"float iso\" 400"),
        kAlbedo * 12, e);
}

TEST_CASE("spots fall off smoothly in the cosine") {
    const double outer = std::cos(30 * M_PI / 180), inner = std::cos(22 * M_PI / 180);
    check_plane(plane_under("LightSource \"spot\" \"rgb I\" [2 3 4] \"point3 from\" [0 0 2] \"point3 to\" [.1 0 0] "
                            "\"float coneangle\" 30 \"float conedeltaangle\" 8"),
                kAlbedo * Rgb{2, 3, 4}, [&](double x, double y) {
                    const double d = std::sqrt(x * x + y * y + 4), a = std::sqrt(0.01 + 4);
                    const double cosine = (0.1 * x + 4) / (a * d);
                    const double t = std::clamp((cosine - outer) / (inner - outer), 0.0, 1.0);
                    return t * t * (3 - 2 * t) * from_point(x, y, 0, 0, 2);
                });
}

TEST_CASE("distant and infinite lights") {
    const double cosine = 2 / std::sqrt(5.0);
    check_plane(plane_under("LightSource \"distant\" \"rgb L\" [2 3 4] \"point3 from\" [1 0 2] \"point3 to\" [0 0 0]"),
                kAlbedo * Rgb{2, 3, 4}, [&](double, double) { return cosine; });
    check_plane(
        plane_under("LightSource \"distant\" \"float illuminance\" 7 \"point3 from\" [0 0 1] \"point3 to\" [0 0 0]"),
        kAlbedo, [](double, double) { return 7; });
    check_plane(plane_under("LightSource \"infinite\" \"rgb L\" [2 3 4]"), kAlbedo * Rgb{2, 3, 4},
                [](double, double) { return M_PI; });
    check_plane(plane_under("LightSource \"infinite\" \"float illuminance\" 5"), kAlbedo,
                [](double, double) { return 5; });
}

TEST_CASE("an environment map that shines from above") {
    const TempFolder folder;
    constexpr int n = 64;
    std::vector<float> texels;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            // Directions of positive z fill the diamond in the middle of the square.
            const bool up = std::abs(2 * (x + 0.5) / n - 1) + std::abs(2 * (y + 0.5) / n - 1) < 1;
            texels.insert(texels.end(), {up ? 2.0f : 0.0f, up ? 3.0f : 0.0f, up ? 4.0f : 0.0f});
        }
    write_float_image(folder / "sky.exr", n, n, texels);
    check_plane(
        plane_under("LightSource \"infinite\" \"string filename\" \"sky.exr\" \"float scale\" .5"),
        kAlbedo * Rgb{1, 1.5f, 2}, [](double, double) { return M_PI; }, &folder);
}

TEST_CASE("projection lights have the intensity of their image, upright") {
    const TempFolder folder;
    // The left half is red and the right one blue, the lower row half as bright.
    write_float_image(folder / "slide.exr", 2, 2, {4, 0, 0, 0, 0, 2, 2, 0, 0, 0, 0, 1});
    // Down from a height of 2, its x along the world's and its y against it; half of its square is 0.75 wide there.
    const std::string slide =
        "AttributeBegin Transform [1 0 0 0 0 -1 0 0 0 0 -1 0 0 0 2 1] LightSource \"projection\" \"float fov\" "
        "41.112090439 "
        "\"string filename\" \"slide.exr\" \"float scale\" 3 AttributeEnd";
    const Scene s = load_pbrt_text(plane_under(slide), {}, &folder);
    Image expected = image_of(kSize, kSize, kAlbedo * Rgb{12, 0, 0}, [&](double film_x, double film_y) {
        const double x = plane_x(film_x), y = plane_y(film_y);
        if (x > 0 || std::fabs(x) > 0.75 || std::fabs(y) > 0.75) return 0.0;
        return (y < 0 ? 1 : 0.5) * from_point(x, y, 0, 0, 2) / M_PI;
    });
    const Image blue = image_of(kSize, kSize, kAlbedo * Rgb{0, 0, 6}, [&](double film_x, double film_y) {
        const double x = plane_x(film_x), y = plane_y(film_y);
        if (x < 0 || std::fabs(x) > 0.75 || std::fabs(y) > 0.75) return 0.0;
        return (y < 0 ? 1 : 0.5) * from_point(x, y, 0, 0, 2) / M_PI;
    });
    for (size_t i = 0; i < blue.rgb.size(); ++i) expected.rgb[i] += blue.rgb[i];
    check_expectation(s, cpu_settings(s, Estimator::nee), expected);
}

TEST_CASE("goniometric lights shine in all directions by their image") {
    const TempFolder folder;
    constexpr int n = 128;
    // Signs of two coordinates are told from the place in the square (Clarberg 2008), and the third one follows.
    std::vector<float> texels;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const double u = 2 * (x + 0.5) / n - 1, v = 2 * (y + 0.5) / n - 1, d = 1 - std::abs(u) - std::abs(v),
                         r = 1 - std::abs(d), z = std::copysign(1 - r * r, d);
            const float value = float((u > 0 ? 1 : 2) * (v > 0 ? 1 : 3) * (2 + z));
            texels.insert(texels.end(), {value, value, value});
        }
    write_float_image(folder / "g.exr", n, n, texels);
    // y of the image is z of the light, which is negative below it, and z is its y.
    check_plane(
        plane_under(
            "AttributeBegin Translate .25 -.25 .7 LightSource \"goniometric\" \"rgb I\" [2 3 4] \"float scale\" .5 "
            "\"string filename\" \"g.exr\" AttributeEnd"),
        kAlbedo * Rgb{1, 1.5f, 2},
        [](double x, double y) {
            const double dx = x - .25, dy = y + .25, l = std::sqrt(dx * dx + dy * dy + .49);
            return (dx > 0 ? 3 : 6) * (2 + dy / l) * from_point(x, y, .25, -.25, .7);
        },
        &folder);
    const Scene s = load_pbrt_text(
        plane_under("LightSource \"goniometric\" \"string filename\" \"g.exr\" \"float power\" 7"), {}, &folder);
    REQUIRE(s.emitters.size() == 6);
    double power = 0;
    for (const Emitter& e : s.emitters) {
        const Texture& t = s.textures[size_t(e.radiance.texture)];
        double sum = 0;
        for (uint32_t y = 0; y < t.height; ++y)
            for (uint32_t x = 0; x < t.width; ++x) sum += double(load_texel(s.view(), t, x, y).y);
        power += 4 * sum / (double(t.width) * t.height) * double(e.radiance.value.y);
    }
    CHECK(power == Approx(7).epsilon(1e-3));
}

TEST_CASE("area lights of two sides shine up and down") {
    const auto light = [](const std::string& sides) {
        return "AttributeBegin Material \"diffuse\" \"rgb reflectance\" [0 0 0] AreaLightSource \"diffuse\" \"rgb L\" "
               "[2 3 4] " +
               sides + " Translate 0 0 2 Shape \"disk\" \"float radius\" 1.5 AttributeEnd";
    };
    const auto from_disk = [](double x, double y) {
        const double a = 1.5, h = 2, r2 = x * x + y * y, c = r2 + a * a + h * h;
        return M_PI / 2 * (1 - (r2 + h * h - a * a) / std::sqrt(c * c - 4 * r2 * a * a));
    };
    check_plane(plane_under(light("\"bool twosided\" true")), kAlbedo * Rgb{2, 3, 4}, from_disk);
    check_plane(plane_under("ReverseOrientation " + light("\"bool twosided\" true")), kAlbedo * Rgb{2, 3, 4},
                from_disk);
    check_plane(plane_under("ReverseOrientation " + light("")), kAlbedo * Rgb{2, 3, 4}, from_disk);
    for (const char* shape : {"\"sphere\"", "\"cylinder\"", "\"disk\"", "\"sphere\" \"float zmin\" 0",
                              "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0] \"integer indices\" [0 1 2]"})
        for (const char* turn : {"", "ReverseOrientation ", "Scale -1 1 1 "}) {
            INFO(shape << turn);
            const Scene s = load_pbrt_text(plane_under(
                std::string("AttributeBegin ") + turn +
                "AreaLightSource \"diffuse\" \"bool twosided\" true Translate 0 0 2 Shape " + shape + " AttributeEnd"));
            REQUIRE(s.emitters.size() == 2);
            // The other one lies behind it: against its normal.
            const auto at = [&](size_t i) {
                return surface_at<kAllFeatures>(s.view(), s.shapes[i].first_primitive, .2f, .2f);
            };
            const SurfacePoint front = at(0), back = at(1);
            CHECK(dot(front.ng, back.ng) == Approx(-1).margin(1e-4));
            const float gap = dot(back.p - front.p, back.ng);
            CHECK(gap > 4e-6f);
            CHECK(gap < 1e-4f);
        }
}

TEST_CASE("lights made on loading: paths, light paths and all strategies together have one image") {
    const TempFolder folder;
    std::vector<float> texels;
    for (int i = 0; i < 64; ++i) texels.insert(texels.end(), {float(1 + i % 3), float(1 + i % 5), float(1 + i / 8)});
    write_float_image(folder / "g.exr", 8, 8, texels);
    const std::string lights[] = {
        "AttributeBegin Translate .2 1.5 .3 LightSource \"goniometric\" \"string filename\" \"g.exr\" AttributeEnd",
        "AttributeBegin Translate 0 2 0 Rotate 90 1 0 0 LightSource \"projection\" \"float fov\" 80 \"string "
        "filename\" "
        "\"g.exr\" AttributeEnd",
        "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [2 3 4] \"bool twosided\" true Translate 0 1 0 Rotate 60 "
        "1 0 0 "
        "Shape \"disk\" \"float radius\" .5 AttributeEnd"};
    for (const std::string& light : lights) {
        INFO(light);
        const Scene s = load_pbrt_text(
            "LookAt 0 2 4 0 .5 0 0 1 0 Camera \"perspective\" \"float fov\" 50 Film \"rgb\" \"integer xresolution\" 24 "
            "\"integer yresolution\" 16 PixelFilter \"box\" Integrator \"path\" \"integer maxdepth\" 4 WorldBegin " +
                light +
                " Material \"diffuse\" \"rgb reflectance\" [.6 .5 .4] Shape \"trianglemesh\" \"point3 P\" [-3 0 -3 3 0 "
                "-3 3 0 3 "
                "-3 0 3] \"integer indices\" [0 1 2 0 2 3] Translate .8 .4 0 Shape \"sphere\" \"float radius\" .4",
            {}, &folder);
        const auto film = [&](const char* integrator, uint64_t seed) {
            RenderSettings settings = cpu_settings(s, Estimator::mis, seed);
            settings.integrator = integrator;
            return to_estimate(render_scene(s, settings, 2048).film);
        };
        const auto paths = film("path", 1);
        ZTestOptions options;
        options.block = 4;
        options.rounding = 1e-4;
        for (const char* integrator : {"light", "bdpt"}) {
            const ZTestResult z = z_test(film(integrator, 2), paths, options);
            INFO(integrator << ": " << z.report());
            CHECK(z.pass);
            CHECK(z.detectable < 0.03);
        }
    }
}

TEST_CASE("area lights shine along their normal, and alpha lets light pass") {
    const std::string quad =
        "AreaLightSource \"diffuse\" \"rgb L\" [2 3 4] Translate 0 0 2 Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 -1 "
        "1 0 1 1 0 "
        "1 -1 0] \"integer indices\" [0 1 2 0 2 3]";
    // The centre of a square of half side a at distance h, by the form factor of its four quarters.
    const auto irradiance = [](double x, double y) {
        const double h = 2;
        double sum = 0;
        for (double sx : {-1.0, 1.0})
            for (double sy : {-1.0, 1.0}) {
                const double a = (1 - sx * x) / h, b = (1 - sy * y) / h;
                sum += a / std::sqrt(1 + a * a) * std::atan(b / std::sqrt(1 + a * a)) +
                       b / std::sqrt(1 + b * b) * std::atan(a / std::sqrt(1 + b * b));
            }
        return sum / 2;  // times π over 2π
    };
    check_plane(plane_under("AttributeBegin " + quad + " AttributeEnd"), kAlbedo * Rgb{2, 3, 4}, irradiance);
    const Scene turned = load_pbrt_text(plane_under("AttributeBegin ReverseOrientation " + quad + " AttributeEnd"));
    check_black(render_scene(turned, cpu_settings(turned, Estimator::nee), 16));
    const std::string veil =
        "AttributeBegin Translate 0 0 1 Material \"diffuse\" \"rgb reflectance\" [0 0 0] Shape \"disk\" \"float "
        "radius\" 50 "
        "\"float alpha\" .25 AttributeEnd ";
    check_plane(plane_under("LightSource \"distant\" \"point3 from\" [0 0 1] \"point3 to\" [0 0 0] " + veil),
                kAlbedo * 0.75f, [](double, double) { return 1; });
}

TEST_CASE("diffuse transmission lets through and gives back what it says") {
    const std::string material =
        "\"diffusetransmission\" \"rgb reflectance\" [.1 .2 .3] \"rgb transmittance\" [.4 .3 .1]";
    const auto one = [](double, double) { return 1.0; };
    check_plane(plane_under("LightSource \"distant\" \"point3 from\" [0 0 1] \"point3 to\" [0 0 0]", material),
                {0.1f, 0.2f, 0.3f}, one);
    check_plane(plane_under("LightSource \"distant\" \"point3 from\" [0 0 -1] \"point3 to\" [0 0 0]", material),
                {0.4f, 0.3f, 0.1f}, one);
}

TEST_CASE("a furnace of every material that keeps all light") {
    for (const char* material : {"\"diffuse\" \"rgb reflectance\" [1 1 1]", "\"dielectric\"", "\"thindielectric\"",
                                 "\"conductor\" \"rgb reflectance\" [1 1 1]"}) {
        INFO(material);
        const Scene s = load_pbrt_text(
            "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 20 Film \"rgb\" \"integer xresolution\" 8 "
            "\"integer yresolution\" 8 PixelFilter \"box\" Integrator \"path\" \"integer maxdepth\" 60 WorldBegin "
            "LightSource "
            "\"infinite\" Material " +
            std::string(material) + " Shape \"sphere\"");
        // Metals of pbrt give back 0.9999 at most.
        const FilmMoments film = render_scene(s, cpu_settings(s, Estimator::mis), 64).film;
        for (size_t i = 0; i < film.sum.size(); ++i) CHECK(film.mean(i) == Approx(1).margin(0.35));
        double mean = 0;
        for (size_t i = 0; i < film.sum.size(); ++i) mean += film.mean(i) / double(film.sum.size());
        CHECK(mean == Approx(1).margin(0.02));
    }
}

TEST_CASE("a scene in both formats has one image, and so has what it is converted to") {
    const TempFolder folder;
    folder.write("floor.ply", kPly);
    const Scene pbrt = load_pbrt_text(kPbrt, {}, &folder), xml = load_mitsuba(folder.write("scene.xml", kXml));
    const ZTestResult z = compared(pbrt, xml, 256);
    INFO(z.report());
    CHECK(z.pass);
    CHECK(z.detectable < 0.02);

    CHECK(check_converted(pbrt, folder / "out/converted.xml", 64).empty());
}

TEST_CASE("a part of the screen is what the crop of the whole screen is") {
    const TempFolder folder;
    folder.write("floor.ply", kPly);
    const auto scene = [&](const std::string& camera, const std::string& film) {
        std::string text = kPbrt;
        const auto exchange = [&](const std::string& from, const std::string& to) {
            text.replace(text.find(from), from.size(), to);
        };
        exchange("Camera \"perspective\" \"float fov\" 35", "Camera " + camera);
        exchange("\"integer xresolution\" 48 \"integer yresolution\" 32", film);
        return load_pbrt_text(text, {}, &folder);
    };
    const std::string whole = "\"integer xresolution\" 48 \"integer yresolution\" 32 \"float cropwindow\" [.5 1 0 .5]",
                      part = "\"integer xresolution\" 24 \"integer yresolution\" 16";
    for (const std::string& type : {std::string("\"perspective\" \"float fov\" 35"), std::string("\"orthographic\"")}) {
        INFO(type);
        const std::string wide = type[1] == 'o' ? " \"float screenwindow\" [-4.5 4.5 -3 3]"
                                                : " \"float screenwindow\" [-1.5 1.5 -1 1]",
                          corner = type[1] == 'o' ? " \"float screenwindow\" [0 4.5 0 3]"
                                                  : " \"float screenwindow\" [0 1.5 0 1]";
        const ZTestResult z = compared(scene(type + wide, whole), scene(type + corner, part), 128);
        INFO(z.report());
        CHECK(z.pass);
    }
}

TEST_CASE("scenes of the project are the same after conversion") {
    const TempFolder folder;
    for (const char* name : {"cornell", "glass", "lights", "materials", "textured"}) {
        INFO(name);
        check_converted(project_scene(name, 48, 27), folder / (std::string(name) + ".xml"));
    }
}

TEST_CASE("coatings, rules of maps and projectors are the same after conversion") {
    const TempFolder folder;
    folder.write("image.png", png_bytes(2, 1, {255, 0, 0, 255, 255, 0}));
    const std::string board =
        R"(<texture type="checkerboard"><rgb name="color0" value="0.2"/><rgb name="color1" value="0.8"/>
           <transform name="to_uv"><scale x="9" y="7"/></transform></texture>)";
    const std::string maps[] = {
        "<bsdf type='coating'><rgb name='sigma_a' value='0.1 0.5 1'/><float name='thickness' value='0.7'/>"
        "<bsdf type='diffuse'/></bsdf>",
        "<bsdf type='roughcoating'><float name='alpha' value='0.3'/><string name='distribution' value='ggx'/>"
        "<bsdf type='roughconductor'/></bsdf>",
        "<bsdf type='bumpmap'><float name='scale' value='0.2'/>" + board + "<bsdf type='diffuse'/></bsdf>",
        "<bsdf type='bumpmap'><boolean name='use_shadowing_function' value='false'/>" + board +
            "<bsdf type='coating'><bsdf type='diffuse'/></bsdf></bsdf>",
        "<bsdf type='twosided'><bsdf type='bumpmap'><boolean name='flip_invalid_normals' value='false'/>" + board +
            "<bsdf type='roughplastic'/></bsdf></bsdf>"};
    std::string shapes;
    for (int i = 0; i < 5; ++i)
        shapes += "<shape type='sphere'><point name='center' x='" + std::to_string(2 * i - 4) +
                  "' y='0' z='0'/><float name='radius' value='0.9'/>" + maps[i] + "</shape>";
    const std::string path = folder.write("scene.xml", R"(<scene version="3.0.0">
        <sensor type="perspective"><float name="fov" value="60"/><transform name="to_world">
            <lookat origin="0,2,9" target="0,0,0" up="0,1,0"/></transform>
            <film type="hdrfilm"><integer name="width" value="48"/><integer name="height" value="27"/></film></sensor>
        <emitter type="projector"><transform name="to_world"><lookat origin="0,3,6" target="0,0,0" up="0,1,0"/></transform>
            <float name="fov" value="70"/><float name="scale" value="3"/>
            <texture type="bitmap" name="irradiance"><string name="filename" value="image.png"/></texture></emitter>
        <emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>)" +
                                                           shapes + "</scene>");
    check_converted(load_mitsuba(path), folder / "out.xml");
}
