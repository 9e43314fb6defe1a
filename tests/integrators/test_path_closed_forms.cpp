// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// seconds: 33
// The path tracer against closed forms: furnaces, direct light of every emitter through every camera, what is seen
// directly, and partial opacity.
#include <array>
#include <functional>

#include "film/exr_io.h"
#include "formats/load.h"
#include "tests/support/closed_forms.h"
#include "tests/support/long_run.h"
#include "transport/bsdf.h"

using namespace ambilux;

namespace {

constexpr Rgb kAlbedo = {0.8f, 0.5f, 0.2f};
constexpr Rgb kLight = {3, 5, 2};

std::string inside_camera(uint32_t size) {
    return "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>"
           "<transform name='to_world'><lookat origin='0.2,-0.1,0.3' target='-0.4,0.3,-0.7' up='0,1,0'/></transform>" +
           square_film(size) + "</sensor>";
}

/// Closed body whose inner side has reflectance `albedo` and radiates kLight.
Scene furnace(const std::string& shape, int max_depth, Rgb albedo = kAlbedo) {
    return scene_from_text(scene_xml(max_depth, inside_camera(8) + "<shape type='" + shape +
                                                    "'><boolean name='flip_normals' value='true'/>" + diffuse(albedo) +
                                                    area_light(kLight) + "</shape>"));
}

/// Light in such a furnace: kLight times 1 + albedo + ... + albedo^(depth-1); the whole series for depth < 0.
Rgb furnace_light(int depth, Rgb albedo = kAlbedo) {
    Rgb sum;
    for (int c = 0; c < 3; ++c) {
        const double a = double(albedo[c]);
        sum[c] = float(double(kLight[c]) * (1 - (depth < 0 ? 0.0 : std::pow(a, depth))) / (1 - a));
    }
    return sum;
}

// ---- a plane at z = 0, seen from above by a camera of [-1,1]² below all lights ----

constexpr uint32_t kSize = 16;
constexpr Rgb kPlaneAlbedo = {0.5f, 0.7f, 0.3f};

const std::string kOrthographic =
    "<sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,0.1' target='0,0,0' "
    "up='0,1,0'/></transform>" +
    square_film(kSize) + "</sensor>";
const std::string kPlane = "<shape type='rectangle'><transform name='to_world'><scale value='1.5'/></transform>" +
                           diffuse(kPlaneAlbedo) + "</shape>";

Scene plane_under(const std::string& light, const std::string& camera = kOrthographic, int max_depth = 2) {
    return scene_from_text(scene_xml(max_depth, camera + kPlane + light));
}

double plane_x(double film_x) { return -1 + 2 * film_x / kSize; }
double plane_y(double film_y) { return 1 - 2 * film_y / kSize; }

/// Image of the plane under irradiance(x,y)·color.
template <class Function>
Image plane_image(Rgb color, Function irradiance) {
    return image_of(kSize, kSize, color * kPlaneAlbedo,
                    [&](double x, double y) { return irradiance(plane_x(x), plane_y(y)) / M_PI; });
}

/// Irradiance per radiance at (x,y,0), normal +z, of a polygon above the horizon (Lambert 1760; Arvo 1995,
/// equation 2.6).
double polygon_irradiance(const std::vector<std::array<double, 3>>& corners, double x, double y) {
    double sum = 0;
    for (size_t i = 0; i < corners.size(); ++i) {
        const auto &p = corners[i], &q = corners[(i + 1) % corners.size()];
        const double a[3] = {p[0] - x, p[1] - y, p[2]}, b[3] = {q[0] - x, q[1] - y, q[2]};
        const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        const double l = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
        sum += std::atan2(l, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * c[2] / l;
    }
    return std::abs(sum) / 2;
}

const std::string kSphereLight =
    "<shape type='sphere'><point name='center' x='0.3' y='-0.2' z='1.5'/><float name='radius' value='0.5'/>" +
    diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";

/// Irradiance per radiance of a sphere above the horizon: pi (r/d)² cos.
double sphere_irradiance(double x, double y) {
    const double dx = 0.3 - x, dy = -0.2 - y, d2 = dx * dx + dy * dy + 1.5 * 1.5;
    return M_PI * 0.25 / d2 * 1.5 / std::sqrt(d2);
}

const std::string kRectangleLight =
    "<shape type='rectangle'><transform name='to_world'><scale x='0.6' y='0.4'/><rotate x='1' angle='180'/><translate "
    "x='0.2' y='0.1' z='1.2'/></transform>" +
    diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";

double rectangle_irradiance(double x, double y) {
    return polygon_irradiance({{-0.4, -0.3, 1.2}, {0.8, -0.3, 1.2}, {0.8, 0.5, 1.2}, {-0.4, 0.5, 1.2}}, x, y);
}

const std::string kDiskLight =
    "<shape type='disk'><transform name='to_world'><scale value='0.6'/><rotate x='1' angle='180'/><translate "
    "x='-0.1' y='0.3' z='1.1'/></transform>" +
    diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";

/// Parallel disk of radius a at height h, l beside the point.
double disk_irradiance(double x, double y) {
    const double a2 = 0.36, h2 = 1.21, l2 = (x + 0.1) * (x + 0.1) + (y - 0.3) * (y - 0.3), s = l2 + h2 + a2;
    return M_PI / 2 * (1 - (l2 + h2 - a2) / std::sqrt(s * s - 4 * a2 * l2));
}

std::string lookat(const char* name, const char* value) {
    return std::string("<transform name='") + name + "'><lookat " + value + "/></transform>";
}

}  // namespace

// ---- furnaces ----

TEST_CASE("B30: a closed sphere that radiates inwards holds L (1-a^n)/(1-a) at max_depth n", "[path]") {
    for (int depth : {1, 2, 3, 4, 5, 6}) {
        INFO("max_depth " << depth);
        check_all_estimators(furnace("sphere", depth), constant_image(8, 8, furnace_light(depth)));
    }
}

TEST_CASE("A closed box that radiates inwards holds the same, with sampled variance", "[path]") {
    // Not nee alone: next to an edge its 1/d² has no variance.
    for (int depth : {1, 2, 3, 4, 5, 6}) {
        const Scene scene = furnace("cube", depth);
        for (const EstimatorCase& e : {kEstimators[0], kEstimators[2], kEstimators[3]}) {
            INFO("max_depth " << depth << ", " << e.name);
            check_expectation(scene, case_settings(scene, e, uint64_t(depth)),
                              constant_image(8, 8, furnace_light(depth)));
        }
    }
}

TEST_CASE("B25: Russian roulette from the first vertex, later and never leave the mean of a furnace", "[path]") {
    for (const char* shape : {"sphere", "cube"}) {
        const Scene scene = furnace(shape, -1);
        for (const EstimatorCase& e : kEstimators) {
            if (std::string(shape) == "cube" && e.estimator == Estimator::nee) continue;  // no variance, see above
            for (int rr_depth : first_or_all<int>(2, {0, 5, 1, -1})) {
                INFO(shape << ", " << e.name << ", rr_depth " << rr_depth);
                RenderSettings s = case_settings(scene, e, uint64_t(10 + rr_depth));
                s.rr_depth = rr_depth;
                if (rr_depth < 0) s.max_depth = 80;  // 0.8^80 = 2e-8
                check_expectation(scene, s, constant_image(8, 8, furnace_light(-1)));
            }
        }
    }
}

TEST_CASE("White furnace: what absorbs nothing shows a constant environment as it is", "[path]") {
    const std::string white_metal = rgb("specular_reflectance", {1, 1, 1});
    const std::pair<const char*, std::string> bsdfs[] = {
        {"diffuse", diffuse({1, 1, 1})},
        {"two-sided diffuse", "<bsdf type='twosided'>" + diffuse({1, 1, 1}) + "</bsdf>"},
        {"dielectric",
         "<bsdf type='dielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf>"},
        {"air in glass",
         "<bsdf type='dielectric'><float name='int_ior' value='1'/><float name='ext_ior' value='1.3'/></bsdf>"},
        {"thin dielectric", "<bsdf type='thindielectric'><float name='int_ior' value='1.7'/></bsdf>"},
        {"mirror", "<bsdf type='conductor'><string name='material' value='none'/>" + white_metal + "</bsdf>"},
        {"plastic", "<bsdf type='plastic'>" + rgb("diffuse_reflectance", {1, 1, 1}) +
                        "<boolean name='nonlinear' value='true'/></bsdf>"},
        {"half-open diffuse", "<bsdf type='mask'><float name='opacity' value='0.5'/><bsdf type='twosided'>" +
                                  diffuse({1, 1, 1}) + "</bsdf></bsdf>"},
    };
    for (const auto& [name, bsdf] : bsdfs) {
        INFO(name);
        const Scene scene = scene_from_text(
            scene_xml(1000, "<sensor type='perspective'><float name='fov' value='40'/>" +
                                lookat("to_world", "origin='0,0,4' target='0,0,0' up='0,1,0'") + square_film(16) +
                                "</sensor><shape type='sphere'>" + bsdf + "</shape><emitter type='constant'>" +
                                rgb("radiance", kLight) + "</emitter>"));
        check_all_estimators(scene, constant_image(16, 16, kLight));
        Scene endless = scene;
        endless.integrator.max_depth = -1;
        check_all_estimators(endless, constant_image(16, 16, kLight));
    }
}

TEST_CASE("A plane under a constant environment shows the albedo of its BSDF", "[path]") {
    // The camera looks at 50 degrees and has parallel rays: every pixel is the albedo for one direction, found by
    // quadrature over the BSDF alone.
    const double angle = 50 * M_PI / 180;
    const Vec3f wi = {float(std::sin(angle)), 0, float(std::cos(angle))};
    const std::string ggx = "<string name='distribution' value='ggx'/>";
    const std::vector<std::string> bsdfs = {
        "<bsdf type='roughconductor'><string name='material' value='Cu'/><float name='alpha_u' value='0.5'/><float "
        "name='alpha_v' value='0.2'/></bsdf>",
        "<bsdf type='roughdielectric'><float name='alpha' value='0.35'/>" + ggx +
            "<float name='int_ior' value='1.6'/></bsdf>",
        "<bsdf type='roughplastic'><float name='alpha' value='0.3'/>" + rgb("diffuse_reflectance", kAlbedo) +
            "<boolean name='nonlinear' value='true'/></bsdf>",
        "<bsdf type='roughdiffuse'><float name='alpha' value='0.5'/>" + rgb("reflectance", kAlbedo) + "</bsdf>",
        "<bsdf type='roughconductor'><string name='material' value='Au'/><float name='alpha' value='0.4'/>" + ggx +
            "</bsdf>",
        diffuse(kAlbedo),
    };
    for (const std::string& bsdf : first_or_all(3, bsdfs)) {
        INFO(bsdf);
        const std::string version = bsdf.find("roughdiffuse") != std::string::npos ? "0.6.0" : "3.0.0";
        std::string text = scene_xml(
            2, "<sensor type='orthographic'>" +
                   lookat("to_world", "origin='7.6604444,0,6.4278761' target='0,0,0' up='0,1,0'") + square_film(16) +
                   "</sensor><shape type='rectangle'>"
                   "<transform name='to_world'><scale value='50'/></transform>" +
                   bsdf + "</shape><emitter type='constant'><rgb name='radiance' value='1'/></emitter>");
        const Scene scene = scene_from_text(text);
        const SceneView view = scene.view();
        const uint32_t material = scene.shapes[0].material;
        const Bsdf b = resolve_bsdf<kAllFeatures>(view, view.bsdfs[scene.materials[material].front], Vec2f{0, 0});
        double albedo[3] = {0, 0, 0};
        const int n = 1200;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < 2 * n; ++j) {
                const double z = -1 + (i + 0.5) * 2 / n, phi = (j + 0.5) * M_PI / n, r = std::sqrt(1 - z * z);
                // The camera looks along -x: the tangent of the rectangle's uv is +x.
                const Rgb f = bsdf_eval<kAllFeatures>(
                    b, wi, {float(r * std::cos(phi)), float(r * std::sin(phi)), float(z)}, TransportMode::radiance);
                for (int c = 0; c < 3; ++c) albedo[c] += double(f[c]) * (2.0 / n) * (M_PI / n);
            }
        check_all_estimators(scene, constant_image(16, 16, {float(albedo[0]), float(albedo[1]), float(albedo[2])}));
    }
}

// ---- direct light ----

TEST_CASE("Direct light of a sphere", "[path]") {
    check_all_estimators(plane_under(kSphereLight), plane_image(kLight, sphere_irradiance));
}

TEST_CASE("Direct light of a rectangle and of a tilted one", "[path]") {
    check_all_estimators(plane_under(kRectangleLight), plane_image(kLight, rectangle_irradiance));
    // lookat turns +z, the emitting side, to the target; corners as the transform puts them.
    const Scene tilted = plane_under(
        "<shape type='rectangle'><transform name='to_world'><scale value='0.5'/><lookat origin='1.5,0.4,2' "
        "target='0,0,0' up='0,0,1'/></transform>" +
        diffuse({0, 0, 0}) + area_light(kLight) + "</shape>");
    std::vector<std::array<double, 3>> corners;
    const double d[3] = {-1.5, -0.4, -2}, dl = std::sqrt(1.5 * 1.5 + 0.4 * 0.4 + 4);
    const double f[3] = {d[0] / dl, d[1] / dl, d[2] / dl};
    const double sl = std::hypot(f[0], f[1]), s[3] = {-f[1] / sl, f[0] / sl, 0};  // up x forward
    const double u[3] = {f[1] * s[2] - f[2] * s[1], f[2] * s[0] - f[0] * s[2],
                         f[0] * s[1] - f[1] * s[0]};  // forward x side
    for (auto [a, b] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
        corners.push_back({1.5 + a * s[0] + b * u[0], 0.4 + a * s[1] + b * u[1], 2 + a * s[2] + b * u[2]});
    check_all_estimators(tilted,
                         plane_image(kLight, [&](double x, double y) { return polygon_irradiance(corners, x, y); }));
}

TEST_CASE("Direct light of a disk", "[path]") {
    check_all_estimators(plane_under(kDiskLight), plane_image(kLight, disk_irradiance));
}

TEST_CASE("Black shapes take from a sky what they would give as lamps", "[path]") {
    const std::string sky = "<emitter type='constant'>" + rgb("radiance", kLight) + "</emitter>";
    const auto without_lamp = [](std::string shape) {
        return shape.erase(shape.find("<emitter"), area_light(kLight).size());
    };
    // A disk across no axis, as a polygon of so many sides that it lacks 2e-6 of its area.
    const std::string tilted_disk =
        "<shape type='disk'><transform name='to_world'><scale value='0.6'/><lookat origin='0.3,0.4,1.2' "
        "target='0.8,0.7,0' up='0,0,1'/></transform>" +
        diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";
    const Frame f = frame_from_normal(normalize(Vec3f{0.5f, 0.3f, -1.2f}));
    std::vector<std::array<double, 3>> rim;
    for (int k = 0; k < 2000; ++k) {
        const double a = 0.6 * std::cos(k * M_PI / 1000), b = 0.6 * std::sin(k * M_PI / 1000);
        rim.push_back({0.3 + a * double(f.s.x) + b * double(f.t.x), 0.4 + a * double(f.s.y) + b * double(f.t.y),
                       1.2 + a * double(f.s.z) + b * double(f.t.z)});
    }
    const std::vector<std::pair<std::string, std::function<double(double, double)>>> shapes = {
        {kSphereLight, sphere_irradiance},
        {tilted_disk, [&](double x, double y) { return polygon_irradiance(rim, x, y); }},
        {kRectangleLight, rectangle_irradiance},
        {kDiskLight, disk_irradiance}};
    for (const auto& [light, irradiance] : first_or_all(2, shapes)) {
        const Image expected = plane_image(kLight, [&](double x, double y) { return M_PI - irradiance(x, y); });
        const Scene scene = plane_under(without_lamp(light) + sky);
        INFO(light);
        check_all_estimators(scene, expected);
        RenderSettings cwbvh = cpu_settings(scene, Estimator::nee, 7),
                       in_double = cpu_settings(scene, Estimator::nee, 8);
        cwbvh.accel = "cwbvh";
        in_double.precision = Precision::in_double;
        check_expectation(scene, cwbvh, expected);
        check_expectation(scene, in_double, expected);
    }
}

TEST_CASE("B8: direct light of points, spots and suns; rays never meet them", "[path]") {
    check_all_estimators(plane_under("<emitter type='point'><point name='position' x='0.4' y='-0.3' z='0.8'/>" +
                                     rgb("intensity", kLight) + "</emitter>"),
                         plane_image(kLight,
                                     [](double x, double y) {
                                         const double d2 = (x - 0.4) * (x - 0.4) + (y + 0.3) * (y + 0.3) + 0.64;
                                         return 0.8 / (d2 * std::sqrt(d2));
                                     }),
                         false);
    // Mitsuba's falloff: full up to beam_width, then linear in the angle to zero at cutoff_angle. The axis is tilted.
    const double ax[3] = {0.1 - 0.3, -0.2 - 0.2, -1.5}, al = std::sqrt(ax[0] * ax[0] + ax[1] * ax[1] + ax[2] * ax[2]);
    check_all_estimators(
        plane_under("<emitter type='spot'>" + rgb("intensity", kLight) +
                    "<float name='cutoff_angle' value='55'/><float name='beam_width' value='10'/>" +
                    lookat("to_world", "origin='0.3,0.2,1.5' target='0.1,-0.2,0' up='0,1,0'") + "</emitter>"),
        plane_image(kLight,
                    [&](double x, double y) {
                        const double w[3] = {x - 0.3, y - 0.2, -1.5},
                                     d = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
                        const double theta =
                            std::acos((w[0] * ax[0] + w[1] * ax[1] + w[2] * ax[2]) / (d * al)) * 180 / M_PI;
                        return std::clamp((55 - theta) / 45, 0.0, 1.0) * 1.5 / (d * d * d);
                    }),
        false);
    check_all_estimators(plane_under("<emitter type='directional'><vector name='direction' x='1' y='-2' z='-2'/>" +
                                     rgb("irradiance", kLight) + "</emitter>"),
                         plane_image(kLight, [](double, double) { return 2.0 / 3; }), false);
}

TEST_CASE("Direct light of environments", "[path]") {
    check_all_estimators(plane_under("<emitter type='constant'>" + rgb("radiance", kLight) + "</emitter>"),
                         plane_image(kLight, [](double, double) { return M_PI; }));
    // An image of three rows: pole, horizon, other pole. Between them the radiance is linear in the angle and in the
    // azimuth, so that over the upper hemisphere the irradiance is pi/2 (pole + mean of the horizon).
    const test::TempFolder folder;
    Image sky{6, 3, {}};
    const float pole[6] = {2, 2, 2, 2, 2, 2}, horizon[6] = {0.5f, 4, 0, 1, 9, 0.5f};
    for (const auto* row : {&pole, &horizon, &pole})
        for (float v : *row)
            for (int c = 0; c < 3; ++c)
                sky.rgb.push_back(row == &pole && sky.rgb.size() > 40 ? 50.0f : v * float(c + 1));
    write_exr((folder.path / "sky.exr").string(), sky);
    const std::string envmap =
        "<emitter type='envmap'><string name='filename' value='sky.exr'/><float name='scale' value='0.5'/><transform "
        "name='to_world'><rotate x='1' angle='90'/></transform></emitter>";
    const Scene scene = load_mitsuba(folder.write("scene.xml", scene_xml(2, kOrthographic + kPlane + envmap)));
    check_all_estimators(scene, plane_image({1, 2, 3}, [](double, double) { return 0.5 * M_PI / 2 * (2 + 2.5); }));
}

TEST_CASE("B10: several lights add up", "[path]") {
    const std::string point = "<emitter type='point'><point name='position' x='0.4' y='-0.3' z='0.8'/>" +
                              rgb("intensity", {1, 1, 1}) + "</emitter>";
    const std::string sky = "<emitter type='constant'>" + rgb("radiance", {0.2f, 0.2f, 0.2f}) + "</emitter>";
    const auto point_irradiance = [](double x, double y) {
        return 0.8 / std::pow((x - 0.4) * (x - 0.4) + (y + 0.3) * (y + 0.3) + 0.64, 1.5);
    };
    const Scene scene = plane_under(kSphereLight + point + sky);
    // The sphere covers its part of the sky.
    const Image hits =
        plane_image({1, 1, 1}, [&](double x, double y) { return 0.2 * (M_PI - sphere_irradiance(x, y)); });
    const Image sphere = plane_image(kLight, sphere_irradiance), delta = plane_image({1, 1, 1}, point_irradiance);
    Image naive = hits, all = hits;
    for (size_t i = 0; i < all.rgb.size(); ++i) {
        naive.rgb[i] += sphere.rgb[i];
        all.rgb[i] += sphere.rgb[i] + delta.rgb[i];
    }
    // The point's light passes by the sphere: it is below its centre, and its shadow lies beyond the horizon of
    // [-1,1]².
    for (const EstimatorCase& e : kEstimators) {
        INFO(e.name);
        check_expectation(scene, case_settings(scene, e, 3), e.estimator == Estimator::naive ? naive : all);
    }
}

TEST_CASE("B21: the plane through perspective and thin lens cameras", "[path]") {
    const std::string view = "<float name='fov' value='90'/>" +
                             lookat("to_world", "origin='0,0,1' target='0,0,0' up='0,1,0'") + square_film(kSize);
    // Above the cameras there is room for the light at 1.2 only.
    check_all_estimators(plane_under(kRectangleLight, "<sensor type='perspective'>" + view + "</sensor>"),
                         plane_image(kLight, rectangle_irradiance));
    check_all_estimators(plane_under(kRectangleLight,
                                     "<sensor type='thinlens'><float name='aperture_radius' value='0.3'/><float "
                                     "name='focus_distance' value='1'/>" +
                                         view + "</sensor>"),
                         plane_image(kLight, rectangle_irradiance));
    // In focus at twice the distance: a pixel sees a disk of radius 0.3 (1 - 1/2) around its point; 12 x 24 points of
    // it.
    const auto blurred = [](double x, double y) {
        double sum = 0;
        for (int i = 0; i < 12; ++i)
            for (int j = 0; j < 24; ++j) {
                const double r = 0.15 * std::sqrt((i + 0.5) / 12), phi = (j + 0.5) * M_PI / 12;
                sum += rectangle_irradiance(x + r * std::cos(phi), y + r * std::sin(phi));
            }
        return sum / 288;
    };
    check_all_estimators(plane_under(kRectangleLight,
                                     "<sensor type='thinlens'><float name='aperture_radius' value='0.3'/><float "
                                     "name='focus_distance' value='2'/>" +
                                         view + "</sensor>"),
                         plane_image(kLight, blurred));
}

// ---- seen directly ----

TEST_CASE("B15: emitters seen directly are as bright as they are, one-sided, and can be hidden", "[path]") {
    const auto seen = [](const std::string& body, int max_depth, bool hide) {
        // From above, looking down at z = 0.
        return scene_from_text(
            scene_xml(max_depth, kOrthographic + body, hide ? "<boolean name='hide_emitters' value='true'/>" : ""));
    };
    const std::string two_sided = "<bsdf type='twosided'>" + diffuse({0.5f, 0.5f, 0.5f}) + "</bsdf>";
    const Image bright = constant_image(kSize, kSize, kLight);
    std::vector<SeenEmitter> cases = emitters_seen_from_above(kLight);
    cases.push_back({"<shape type='rectangle'>" + kTurnedDown + two_sided + area_light(kLight) + "</shape>", false});
    for (const SeenEmitter& c : cases)
        for (const EstimatorCase& e : kEstimators)
            for (int depth : {0, 1, 2, 4}) {
                INFO(c.body << " " << e.name << " max_depth " << depth);
                const Scene open = seen(c.body, depth, false), hidden = seen(c.body, depth, true);
                if (c.visible && depth > 0) {
                    const RenderResult r = render_scene(open, case_settings(open, e), 4);
                    CHECK(worst_difference(r.film, bright) < 1e-6);
                    CHECK(r.stats.invalid.total() == 0);
                } else {
                    check_black(render_scene(open, case_settings(open, e), 4),
                                1e-9);  // a turned plane is not quite flat
                }
                check_black(render_scene(hidden, case_settings(hidden, e), 4), 1e-9);
            }
}

TEST_CASE("An environment image is seen where it is", "[path]") {
    const test::TempFolder folder;
    Image sky{4, 3, {}};
    for (int i = 0; i < 12; ++i)
        for (int c = 0; c < 3; ++c) sky.rgb.push_back(float(1 + i / 4 * 2 + i % 4) * float(c + 1));
    write_exr((folder.path / "sky.exr").string(), sky);
    // Looking along -z, 60 degrees wide. Columns are periodic with centres at (i+0.5)/4, rows at 0, 1/2, 1 from the top
    // down.
    const Scene scene = load_mitsuba(folder.write(
        "scene.xml",
        scene_xml(1, "<sensor type='perspective'><float name='fov' value='60'/>" +
                         lookat("to_world", "origin='1,2,3' target='1,2,2' up='0,1,0'") + square_film(kSize) +
                         "</sensor><emitter type='envmap'><string name='filename' value='sky.exr'/></emitter>")));
    const Image expected = image_of(kSize, kSize, {1, 2, 3}, [](double px, double py) {
        const double t = std::tan(M_PI / 6), x = t * plane_x(px), y = t * plane_y(py);
        double u = std::atan2(x, 1) / (2 * M_PI);
        const double v = std::acos(y / std::sqrt(x * x + y * y + 1)) / M_PI;
        u = (u < 0 ? u + 1 : u) * 4 - 0.5;
        const double fx = u - std::floor(u), row = v * 2, fy = row - std::floor(row);
        const int i = int(std::floor(u)) & 3, j = int(row);
        const auto at = [](int a, int b) { return 1.0 + 2 * b + (a & 3); };
        return (at(i, j) * (1 - fx) + at(i + 1, j) * fx) * (1 - fy) +
               (at(i, j + 1) * (1 - fx) + at(i + 1, j + 1) * fx) * fy;
    });
    for (const EstimatorCase& e : kEstimators) check_expectation(scene, case_settings(scene, e), expected);
}

TEST_CASE("A light that faces away lights nothing", "[path]") {
    const std::string away =
        "<shape type='rectangle'><transform name='to_world'><scale x='0.6' y='0.4'/><translate "
        "z='1.2'/></transform><bsdf type='twosided'>" +
        diffuse({0.5f, 0.5f, 0.5f}) + "</bsdf>" + area_light(kLight) + "</shape>";
    for (const EstimatorCase& e : kEstimators) {
        const Scene scene = plane_under(away, kOrthographic, 6);
        check_black(render_scene(scene, case_settings(scene, e), 64));
    }
}

// ---- specular paths: depth by depth ----

TEST_CASE("B6: a light behind a glass slab, segment by segment", "[path]") {
    // At normal incidence both faces reflect R = ((n-1)/(n+1))²; radiance that leaves is (1-R)² after 3 segments, and
    // R² of it more after every 2 further ones.
    const double n = 1.5, r = std::pow((n - 1) / (n + 1), 2), t2 = (1 - r) * (1 - r);
    const std::string slab =
        "<shape type='cube'><transform name='to_world'><scale x='5' y='5' z='0.02'/></transform><bsdf "
        "type='dielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf></shape>";
    const std::string lamp =
        "<shape type='rectangle'><transform name='to_world'><scale value='5'/><translate z='-1'/></transform>" +
        diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";
    for (auto [depth, expected] : {std::pair{1, 0.0},
                                   {2, 0.0},
                                   {3, t2},
                                   {4, t2},
                                   {5, t2 * (1 + r * r)},
                                   {7, t2 * (1 + r * r + r * r * r * r)},
                                   {-1, t2 / (1 - r * r)}}) {
        INFO("max_depth " << depth);
        const Scene scene = scene_from_text(scene_xml(depth, kOrthographic + slab + lamp));
        if (expected == 0)
            for (const EstimatorCase& e : kEstimators) check_black(render_scene(scene, case_settings(scene, e), 16));
        else
            check_all_estimators(scene, constant_image(kSize, kSize, kLight * float(expected)));
    }
    // A thin sheet lets 1 - 2R/(1+R) through with two segments.
    const Scene sheet = scene_from_text(
        scene_xml(2, kOrthographic +
                         "<shape type='rectangle'><transform name='to_world'><scale value='5'/></transform><bsdf "
                         "type='thindielectric'><float name='int_ior' value='1.5'/>"
                         "<float name='ext_ior' value='1'/></bsdf></shape>" +
                         lamp));
    check_all_estimators(sheet, constant_image(kSize, kSize, kLight * float(1 - 2 * r / (1 + r))));
}

TEST_CASE("Light seen in a mirror", "[path]") {
    const Scene scene =
        scene_from_text(scene_xml(2, kOrthographic +
                                         "<shape type='rectangle'><bsdf type='conductor'><rgb name='eta' "
                                         "value='1.5,0.2,1'/><rgb name='k' value='2,4,0'/>" +
                                         rgb("specular_reflectance", {0.9f, 0.8f, 1}) +
                                         "</bsdf></shape><shape type='rectangle'><transform name='to_world'><scale "
                                         "value='5'/><rotate x='1' angle='180'/><translate z='1'/></transform>" +
                                         area_light(kLight) + "</shape>"));
    const auto reflected = [](double eta, double k) {
        return ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
    };
    // The last channel is an index of 1 without absorption: nothing is reflected.
    check_all_estimators(
        scene,
        constant_image(kSize, kSize, kLight * Rgb{float(0.9 * reflected(1.5, 2)), float(0.8 * reflected(0.2, 4)), 0}));
}

// ---- opacity ----

TEST_CASE("G11: surfaces of partial opacity scale light by what they let pass and use up no depth", "[path]") {
    const auto sheet = [](double z, double opacity) {
        return "<shape type='rectangle'><transform name='to_world'><scale value='5000'/><translate z='" +
               std::to_string(z) + "'/></transform><bsdf type='mask'><float name='opacity' value='" +
               std::to_string(opacity) + "'/>" + diffuse({0, 0, 0}) + "</bsdf></shape>";
    };
    struct Case {
        const char* name;
        std::string sheets;
        double passes;
        int depth = 2;
    };
    std::string nothing;
    for (int i = 0; i < 5; ++i) nothing += sheet(0.02 + 0.01 * i, 0) + sheet(0.3 + 0.1 * i, 0);
    const std::string veil =
        "<shape type='cube'><transform name='to_world'><scale x='5000' y='5000' z='0.1'/><translate "
        "z='0.6'/></transform><bsdf type='mask'><float name='opacity' value='0.3'/>" +
        diffuse({0, 0, 0}) + "</bsdf></shape>";
    const std::vector<Case> cases = {
        {"a sheet before the camera", sheet(0.05, 0.3), 0.7 * 0.7},  // and the light crosses it too
        {"one sheet towards the light", sheet(0.5, 0.3), 0.7},
        {"two sheets towards the light", sheet(0.5, 0.3) + sheet(0.6, 0.3), 0.49},
        {"a closed box towards the light", veil, 0.49},
        {"ten sheets that are not there", nothing, 1},
        {"ten sheets and a third segment", nothing, 1, 3},
    };
    for (const Case& c : first_or_all(2, cases)) {
        INFO(c.name);
        const std::string sky = "<emitter type='constant'>" + rgb("radiance", kLight) + "</emitter>";
        check_all_estimators(plane_under(sky + c.sheets, kOrthographic, c.depth),
                             plane_image(kLight * float(c.passes), [](double, double) { return M_PI; }));
        const Scene lit = plane_under("<emitter type='directional'><vector name='direction' x='0' y='0' z='-1'/>" +
                                      rgb("irradiance", kLight) + "</emitter>" + c.sheets);
        check_all_estimators(lit, plane_image(kLight * float(c.passes), [](double, double) { return 1.0; }), false);
    }
    // The light itself seen through sheets, at depth 1.
    const Scene seen = scene_from_text(scene_xml(1, kOrthographic + sheet(0.05, 0.3) + sheet(0.04, 0.3) +
                                                        "<shape type='rectangle'>" + area_light(kLight) + "</shape>"));
    check_all_estimators(seen, constant_image(kSize, kSize, kLight * 0.49f));
}

TEST_CASE("G11: a ray meets both sides of a sphere or cylinder of partial opacity", "[path]") {
    const std::string lamp =
        "<shape type='rectangle'><transform name='to_world'><scale value='5'/><translate z='-6'/></transform>" +
        area_light(kLight) + "</shape>";
    const std::string black = "<bsdf type='mask'><float name='opacity' value='0.3'/><bsdf type='twosided'>" +
                              diffuse({0, 0, 0}) + "</bsdf></bsdf>";
    for (const std::string shape :
         {"<shape type='sphere'><point name='center' x='0' y='0' z='-2.5'/><float name='radius' value='2'/>",
          "<shape type='cylinder'><float name='radius' value='2'/><point name='p0' x='-2' y='0' z='-2.5'/><point "
          "name='p1' x='2' y='0' z='-2.5'/>"})
        for (const char* accel : {"embree", "cwbvh"}) {
            INFO(shape << " " << accel);
            const Scene scene = scene_from_text(scene_xml(1, kOrthographic + shape + black + "</shape>" + lamp));
            RenderSettings s = cpu_settings(scene, Estimator::mis);
            s.accel = accel;
            check_expectation(scene, s, constant_image(kSize, kSize, kLight * 0.49f));
        }
}
