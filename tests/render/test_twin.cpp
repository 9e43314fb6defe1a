// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// The twin in double precision: closed forms, the same expectation as the renderers, and what it can do that floats
// cannot.
#include "core/error.h"
#include "render/twin/path_sample.h"
#include "render/twin/scene.h"
#include "scene/info.h"
#include "tests/support/closed_forms.h"
#include "tests/support/film_difference.h"
#include "tests/support/spherical_scene.h"

using namespace ambilux;

namespace {

RenderSettings twin_settings(const Scene& scene, const std::string& integrator = "path", uint64_t seed = 1) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.precision = Precision::in_double;
    s.integrator = integrator;
    return s;
}

RenderSettings single(RenderSettings s) {
    s.precision = Precision::single;
    return s;
}

double relative_difference_of_means(const FilmMoments& a, const FilmMoments& b) {
    double sum_a = 0, sum_b = 0;
    for (size_t i = 0; i < a.sum.size(); ++i) sum_a += a.sum[i], sum_b += b.sum[i];
    return std::abs(sum_a - sum_b) / sum_a;
}

constexpr Rgb kLight = {3, 5, 2}, kAlbedo = {0.8f, 0.5f, 0.2f};

/// A sphere that radiates inwards: kLight (1 + a + ... + a^(depth-1)) everywhere.
Scene furnace(const std::string& shape, int max_depth) {
    return scene_from_text(scene_xml(
        max_depth,
        "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>"
        "<transform name='to_world'><lookat origin='0.2,-0.1,0.3' target='-0.4,0.3,-0.7' up='0,1,0'/>"
        "</transform>" +
            square_film(8) + "</sensor><shape type='" + shape + "'><boolean name='flip_normals' value='true'/>" +
            diffuse(kAlbedo) + area_light(kLight) + "</shape>"));
}

Image furnace_image(int depth) {
    Rgb sum;
    for (int c = 0; c < 3; ++c) {
        const double a = double(kAlbedo[c]);
        sum[c] = float(double(kLight[c]) * (1 - std::pow(a, depth)) / (1 - a));
    }
    return constant_image(8, 8, sum);
}

/// A plane seen by an orthographic camera of [-1,1]² under a sphere lamp, all of it `at` = (x,y,z) on from the origin,
/// where a small black disk lies, so that the loader leaves the rest where it is.
Scene plane_under_sphere(double at, double height, double radius, const std::string& blocker = "") {
    const std::string there = std::to_string(at);
    const auto moved = [&](const std::string& before, double z = 0) {
        return "<transform name='to_world'>" + before + "<translate x='" + there + "' y='" + there + "' z='" +
               std::to_string(at + z) + "'/></transform>";
    };
    const std::string far_disk = "<shape type='disk'><transform name='to_world'><scale value='0.5'/></transform>" +
                                 diffuse({0, 0, 0}) + "</shape>";
    return scene_from_text(scene_xml(
        2, "<sensor type='orthographic'>" + moved("<rotate x='1' angle='180'/>", 0.125) + square_film(16) +
               "</sensor><shape type='rectangle'>" + moved("<scale value='1.5'/>") + diffuse(kAlbedo) +
               "</shape><shape type='sphere'>" + moved("<scale value='" + std::to_string(radius) + "'/>", height) +
               area_light(kLight) + "</shape>" + blocker + (at == 0 ? "" : far_disk)));
}

/// pi (r/d)² cos.
Image plane_under_sphere_image(double height, double radius) {
    return image_of(16, 16, kLight * kAlbedo, [=](double x, double y) {
        const double px = -1 + x / 8, py = 1 - y / 8, d2 = px * px + py * py + height * height;
        return radius * radius * height / (d2 * std::sqrt(d2));
    });
}

}  // namespace

TEST_CASE("Constants, functions and bits of the copied headers are those of doubles", "[twin]") {
    static_assert(std::is_same_v<decltype(twin::Vec3f::x), double>);
    static_assert(std::is_same_v<decltype(twin::SceneView::tables), const float*>);
    static_assert(twin::kPi == M_PI && twin::kInvPi == M_1_PI);
    static_assert(twin::kRoundingUnit == 0x1p-53 && kRoundingUnit == 0x1p-24f);
    static_assert(twin::kOneMinusEpsilon == 1 - 0x1p-53 && kOneMinusEpsilon == 0x1.fffffep-1f);
    CHECK(twin::next_float_up(1.0) == 1 + 0x1p-52);
    CHECK(twin::float_bits(twin::kInfinity) == twin::kInfinityBits);
    CHECK(float_bits(kInfinity) == kInfinityBits);
    CHECK(twin::is_valid_radiance({1e300, -0.0, 1e-300}));
    for (const double wrong : {-1.0, double(kInfinity), std::nan("")})
        CHECK(!twin::is_valid_radiance({1.0, wrong, 1.0}));
    for (const double x : {-0.7, -0.3, 0.0, 1e-3, 0.6}) {
        double sine, cosine;
        twin::sin_cos_octant(x, sine, cosine);
        CHECK(sine == std::sin(x));
        CHECK(cosine == std::cos(x));
        CHECK(std::abs(twin::inverse_erf(std::erf(4 * x)) - 4 * x) < 1e-11);
    }
    for (const double scale : {1e-150, 1.0, 1e150}) {
        const twin::Vec3f n = twin::detail::triangle_normal({scale, 0, 0}, {scale, scale, scale});
        CHECK(n.x == 0);
        CHECK(std::abs(n.y + M_SQRT1_2) < 1e-15);
        CHECK(std::abs(n.z - M_SQRT1_2) < 1e-15);
    }
}

TEST_CASE("Furnaces hold the light of their closed form", "[twin]") {
    for (const int depth : {1, 4}) {
        const Scene sphere = furnace("sphere", depth), cube = furnace("cube", depth);
        for (const EstimatorCase& e : kEstimators) {
            INFO("depth " << depth << ", " << e.name);
            RenderSettings s = case_settings(sphere, e);
            s.precision = Precision::in_double;
            check_expectation(sphere, s, furnace_image(depth));
        }
        check_expectation(sphere, twin_settings(sphere, "bdpt"), furnace_image(depth));
        check_expectation(cube, twin_settings(cube), furnace_image(depth));
    }
}

TEST_CASE("A plane under a sphere lamp", "[twin]") {
    const Scene scene = plane_under_sphere(0, 2, 0.5);
    for (const char* integrator : {"path", "bdpt"}) {
        INFO(integrator);
        check_expectation(scene, twin_settings(scene, integrator), plane_under_sphere_image(2, 0.5));
    }
}

TEST_CASE("At equal seeds images are those of the renderers but for the rounding of floats", "[twin]") {
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured"})
        for (const char* integrator : {"path", "bdpt", "light"}) {
            INFO(name << ", " << integrator);
            const Scene scene = project_scene(name, 24, 16);
            const RenderSettings s = twin_settings(scene, integrator, 5);
            const RenderResult twin = render_scene(scene, s, 16), floats = render_scene(scene, single(s), 16);
            CHECK(twin.stats.invalid.total() == 0);
            // A path that decides differently would be worth a hundredth; narrow lobes lose up to 1e-4 in floats.
            CHECK(relative_difference(twin.film, floats.film) < 2e-3);
            CHECK(relative_difference_of_means(twin.film, floats.film) < 1e-4);
            // More than nothing: floats were not compared with themselves.
            CHECK(relative_difference(twin.film, floats.film) > 1e-9);
        }
}

TEST_CASE("A spherical sensor has the image of the renderers at equal seeds, over the edges of its film too",
          "[twin]") {
    const Scene scene = scene_from_text(room_around(spherical_camera(16, 8, "gaussian"), 4));
    for (const char* integrator : {"path", "bdpt", "light"}) {
        INFO(integrator);
        const RenderSettings s = twin_settings(scene, integrator, 5);
        const RenderResult twin = render_scene(scene, s, 16), floats = render_scene(scene, single(s), 16);
        CHECK(twin.stats.invalid.total() == 0);
        CHECK(relative_difference(twin.film, floats.film) < 2e-3);
        CHECK(relative_difference_of_means(twin.film, floats.film) < 1e-4);
    }
}

TEST_CASE("A crop is that part of the image in both precisions, with light that lands near its edges", "[twin]") {
    Scene scene = project_scene("lights", 24, 16);
    scene.sensor.crop_x = 7;
    scene.sensor.crop_y = 3;
    scene.sensor.crop_width = 11;
    scene.sensor.crop_height = 9;
    for (const char* integrator : {"path", "light"}) {
        INFO(integrator);
        const RenderSettings s = twin_settings(scene, integrator, 5);
        const FilmMoments twin = render_scene(scene, s, 16).film, floats = render_scene(scene, single(s), 16).film;
        REQUIRE(twin.sum.size() == 11 * 9 * 3);
        CHECK(relative_difference(twin, floats) < 2e-3);
        CHECK(relative_difference_of_means(twin, floats) < 1e-4);
    }
}

TEST_CASE("Disks are ellipses of any affine map, in both precisions", "[twin]") {
    for (const char* map :
         {"<scale x='0.8' y='0.3' z='-0.5'/>", "<matrix value='1 .5 .2 0 .1 .6 -.3 0 0 .2 -1 0 0 0 0 1'/>"})
        for (const char* integrator : {"path", "bdpt", "light"}) {
            INFO(map << ", " << integrator);
            const Scene scene = scene_from_text(scene_xml(
                3,
                "<sensor type='orthographic'><transform name='to_world'><rotate x='1' angle='150'/><translate "
                "y='1' z='2'/></transform>" +
                    square_film(16) + "</sensor><shape type='rectangle'>" + diffuse(kAlbedo) +
                    "</shape><shape type='disk'><transform name='to_world'>" + map +
                    "<translate z='0.9'/></transform>" + area_light(kLight) + "</shape>"));
            const RenderSettings s = twin_settings(scene, integrator, 5);
            const FilmMoments twin = render_scene(scene, s, 16).film, floats = render_scene(scene, single(s), 16).film;
            CHECK(relative_difference(twin, floats) < 1e-4);
            CHECK(relative_difference(twin, floats) > 1e-9);
        }
}

TEST_CASE("A wall lit by a disk that it sees nearly edge-on has the same light in both precisions", "[twin]") {
    const Scene scene = scene_from_text(scene_xml(
        2,
        "<sensor type='orthographic'><transform name='to_world'><scale x='1' y='0.5'/><lookat origin='0,-3.5,0' "
        "target='8,-3.5,0' up='0,0,1'/></transform>" +
            square_film(16) +
            "</sensor><shape type='rectangle'><transform name='to_world'><scale value='16'/><rotate "
            "y='1' angle='-90'/><translate x='8'/></transform>" +
            diffuse(kAlbedo) +
            "</shape><shape type='disk'><transform name='to_world'><scale x='0.6' y='0.8' z='-0.74'/><rotate x='-0.95' "
            "y='0.24' z='-0.22' angle='87.67'/><translate x='-2.5' y='0.8' z='1.7'/></transform>" +
            area_light(kLight) + "</shape>"));
    const RenderSettings s = twin_settings(scene, "path", 5);
    const FilmMoments twin = render_scene(scene, s, 64).film, floats = render_scene(scene, single(s), 64).film;
    CHECK(relative_difference(twin, floats) < 1e-3);
    CHECK(relative_difference(twin, floats) > 1e-9);
}

TEST_CASE("At other seeds images have the expectation of the renderers", "[twin]") {
    for (const char* name : {"cornell", "furnace", "lights", "materials", "textured"}) {
        INFO(name);
        const Scene scene = project_scene(name, 24, 16);
        const FilmMoments twin = render_scene(scene, twin_settings(scene, "path", 5), 256).film;
        const FilmMoments floats = render_scene(scene, single(twin_settings(scene, "path", 6)), 1024).film;
        // Two images that agree to rounding have no variance to be tested against.
        ZTestOptions options;
        options.rounding = 1e-5;
        const ZTestResult z = z_test(to_estimate(twin), to_estimate(floats), options);
        INFO(z.report());
        CHECK(z.pass);
    }
}

TEST_CASE("A lamp half a unit above a plane, a million units from the origin, lights it in double precision alone",
          "[twin]") {
    const double at = 1e6, height = 0.5, radius = 0.25;
    const Scene scene = plane_under_sphere(at, height, radius);
    REQUIRE(scene.origin == std::array<double, 3>{});  // where floats have steps of 1/16
    const Image expected = plane_under_sphere_image(height, radius);
    for (const char* integrator : {"path", "bdpt"})
        check_expectation(scene, twin_settings(scene, integrator), expected);
    const FilmMoments floats = render_scene(scene, single(twin_settings(scene)), 256).film;
    CHECK(!z_test(to_estimate(floats), exact_estimate(expected)).pass);
}

TEST_CASE("Directions of long subpaths are unit, and their vertices on their surfaces, within the rounding of doubles",
          "[twin]") {
    const Scene scene = scene_from_text(scene_xml(
        -1, "<sensor type='perspective'>" + square_film(4) +
                "</sensor><shape type='sphere'><boolean name='flip_normals' value='true'/><bsdf type='roughconductor'>"
                "<float name='alpha' value='0.1'/><string name='material' value='none'/></bsdf></shape>"
                "<shape type='sphere'><float name='radius' value='0.3'/><bsdf type='dielectric'/></shape>"));
    const twin::DoubleScene in_double(scene);
    const twin::SceneView view = in_double.view();
    const twin::Tracer tracer(view);
    twin::Rules<twin::UnidirectionalMis> rules{};
    rules.max_depth = rules.rr_depth = twin::kMaxDepth;
    uint32_t longest = 0;
    double worst_length = 0, worst_distance = 0;
    for (uint32_t index = 0; index < 100; ++index) {
        const twin::RandomNumbers numbers = {{7, index, 0, twin::Stream::test}};
        twin::Subpath<twin::UnidirectionalMis> path{};
        path.origin = {0.5, 0.1, 0.2};
        path.direction = twin::square_to_sphere({numbers.camera().x, numbers.camera().y});
        path.throughput = {1, 1, 1};
        path.roulette_scale = 1;
        for (path.depth = 1; path.depth < 1000;) {
            const twin::Hit hit = tracer.closest({path.origin, twin::kInfinity, path.direction, 0});
            REQUIRE(hit.prim != twin::kNone);
            const twin::SurfacePoint point = twin::surface_at<twin::kAllFeatures>(view, hit.prim, hit.u, hit.v);
            const double radius = hit.prim == 0 ? 1.0 : double(0.3f);
            worst_distance = std::max(worst_distance, std::abs(twin::length(point.p) - radius));
            const auto vertex = twin::vertex_at<twin::kAllFeatures>(view, rules, twin::Side::eye, path, point);
            if (!twin::scatter<twin::kAllFeatures>(rules, twin::Side::eye, vertex,
                                                   numbers.scatter(twin::Side::eye, path.depth), path))
                break;
            worst_length = std::max(worst_length, std::abs(twin::length(path.direction) - 1) / path.depth);
        }
        longest = std::max(longest, path.depth);
    }
    CHECK(longest > 100);
    CHECK(worst_length < 1e-15);  // per vertex
    CHECK(worst_distance < 1e-15);
}

TEST_CASE("The twin's boxes hold up to four primitives each, and count their bytes", "[twin]") {
    const auto bytes = [](const std::string& shapes) {
        const Scene scene =
            scene_from_text(scene_xml(2, "<sensor type='perspective'>" + square_film(4) + "</sensor>" + shapes));
        const twin::DoubleScene in_double(scene);
        return twin::Tracer(in_double.view()).memory_bytes();
    };
    constexpr uint64_t kNode = 6 * 8 + 2 * 4;
    CHECK(bytes("<shape type='sphere'/>") == kNode + 4);
    CHECK(bytes("<shape type='rectangle'/>") == kNode + 2 * 4);
    CHECK(bytes("<shape type='cube'/>") == 7 * kNode + 12 * 4);  // 12, 6 and 6, 3 and 3 and 3 and 3
}

TEST_CASE("Emitters of the twin have maps whose inverses, and directions whose lengths, are those of doubles",
          "[twin]") {
    Scene scene;
    const EmitterType types[] = {EmitterType::spot, EmitterType::projector, EmitterType::envmap,
                                 EmitterType::directional, EmitterType::point};
    for (const EmitterType type : types) {
        Emitter& e = scene.emitters.emplace_back();
        e.type = type;
        e.direction = {0.6f, 0.7f, 0.3f};
        const float turn[3][4] = {{0.36f, -0.8f, 0.48f, 3}, {0.48f, 0.6f, 0.64f, -2}, {-0.8f, 0, 0.6f, 0.1f}};
        for (int i = 0; i < 3; ++i) std::copy(std::begin(turn[i]), std::end(turn[i]), e.to_world.m[i]);
    }
    const twin::DoubleScene in_double(scene);
    for (size_t k = 0; k < scene.emitters.size(); ++k) {
        const twin::Emitter& e = in_double.view().emitters[k];
        CAPTURE(uint32_t(types[k]));
        const bool axis = types[k] == EmitterType::spot || types[k] == EmitterType::directional;
        CHECK((std::abs(twin::length(e.direction) - 1) < 1e-15) == axis);
        CHECK(std::abs(twin::length(e.direction) - 1) < 0.04);
        if (k >= 3) continue;  // without a map
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 4; ++j) {
                double there_and_back = j == 3 ? e.to_local.m[i][3] : 0;
                for (int l = 0; l < 3; ++l) there_and_back += e.to_local.m[i][l] * e.to_world.m[l][j];
                CHECK(std::abs(there_and_back - (i == j)) < 4e-15);
                CHECK(std::abs(e.to_world.m[i][j] - double(scene.emitters[k].to_world.m[i][j])) < 1e-6);
            }
    }
}

TEST_CASE("The twin does not meet triangles that rounding has made a point or an edge", "[twin]") {
    // From here all corners are one direction, though the plane is not edge-on.
    const auto hit = [](const std::string& scale, twin::Vec3f from) {
        const Scene scene = scene_from_text(scene_xml(
            2, "<sensor type='perspective'>" + square_film(4) +
                   "</sensor><shape type='rectangle'><transform name='to_world'>" + scale + "</transform></shape>"));
        const twin::DoubleScene in_double(scene);
        return twin::Tracer(in_double.view()).closest({from, twin::kInfinity, -from, 0});
    };
    const twin::Hit large = hit("<scale value='1'/>", {0.25, 0.25, 1});
    CHECK(large.prim != twin::kNone);
    CHECK(std::abs(large.t - 1) < 1e-15);
    CHECK(hit("<scale value='1e-17'/>", {0.25, 0.25, 1}).prim == twin::kNone);
    CHECK(hit("<scale value='1'/>", {1, 0.5, 0}).prim == twin::kNone);  // along it
}

TEST_CASE("The twin's rays that begin on a sphere or a cylinder meet its other side, and not the one that they leave") {
    const auto tracer_hit = [](const std::string& shape, twin::Vec3f from, twin::Vec3f d, bool& occluded) {
        const Scene scene =
            scene_from_text(scene_xml(2, "<sensor type='perspective'>" + square_film(4) + "</sensor>" + shape));
        const twin::DoubleScene in_double(scene);
        const twin::Tracer tracer(in_double.view());
        occluded = tracer.occluded({from, twin::kInfinity, d, 0});
        return tracer.closest({from, twin::kInfinity, d, 0});
    };
    const std::string sphere =
                          "<shape type='sphere'><point name='center' x='1' y='0' z='0'/><float name='radius' "
                          "value='2'/></shape>",
                      cylinder =
                          "<shape type='cylinder'><point name='p0' x='0' y='0' z='-1'/><point name='p1' x='0' "
                          "y='0' z='4'/><float name='radius' value='2'/></shape>";
    struct Case {
        const std::string& shape;
        twin::Vec3f from, d;
        double t;
    };
    for (const auto& [shape, from, d, t] : {Case{sphere, {1, 0, 2}, {0.6, 0, -0.8}, 2 * 2 * 0.8},
                                            {sphere, {1, 0, 2}, {0.6, 0, 0.8}, 0},
                                            {sphere, {-1, 0, 0}, {1, 0, 0}, 4},
                                            {sphere, {-1.5, 0, 0}, {1, 0, 0}, 0.5},
                                            {sphere, {1, 0, 1}, {0, 0, 1}, 1},
                                            {cylinder, {2, 0, 0}, {-0.8, 0, 0.6}, 2 * 2 / 0.8},
                                            {cylinder, {2, 0, 0}, {0.8, 0, 0.6}, 0},
                                            {cylinder, {2, 0, 0}, {-0.6, 0, 0.8}, 0},
                                            {cylinder, {0, 3, 0}, {0, -1, 0}, 1}}) {
        INFO((&shape == &sphere ? "sphere" : "cylinder")
             << " from " << from.x << " " << from.y << " " << from.z << " along " << d.x << " " << d.y << " " << d.z);
        bool occluded;
        const twin::Hit hit = tracer_hit(shape, from, d, occluded);
        CHECK((hit.prim != twin::kNone) == (t > 0));
        CHECK(occluded == (t > 0));
        if (t > 0) CHECK(std::abs(hit.t - t) < 1e-14);
    }
}

TEST_CASE("The twin repeats its image bit by bit, in parts too", "[twin]") {
    const Scene scene = project_scene("glass", 24, 16);
    const RenderSettings s = twin_settings(scene, "bdpt");
    const FilmMoments whole = render_scene(scene, s, 4).film;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    REQUIRE(renderer->render(0, 1) == 1);
    REQUIRE(renderer->render(1, 3) == 3);
    CHECK(renderer->film().sum == whole.sum);
    CHECK(renderer->film().sum_squares == whole.sum_squares);
    CHECK(renderer->film().samples == 4);
    const volatile bool stop = true;
    CHECK(renderer->render(4, 3, &stop) == 0);
}

TEST_CASE(
    "The twin's statistics are those of a render: samples, rays, bytes and how many samples take a fifth of a second",
    "[twin]") {
    const Scene scene = project_scene("cornell", 24, 16);
    for (const char* integrator : {"path", "bdpt"}) {
        INFO(integrator);
        const RenderSettings s = twin_settings(scene, integrator, 5);
        const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
        CHECK(renderer->preferred_batch() == 1);
        CHECK(renderer->stats().samples == 0);
        REQUIRE(renderer->render(0, 4) == 4);
        const RenderStats twin = renderer->stats(), floats = render_scene(scene, single(s), 4).stats;
        CHECK(twin.backend == "cpu");
        CHECK(twin.accel == "median_bvh");
        CHECK_THAT(twin.device, StartsWith("CPU, "));
        CHECK(twin.device.ends_with(" threads, double precision"));
        CHECK(twin.settings.integrator == integrator);
        CHECK(twin.settings.precision == Precision::in_double);
        CHECK(twin.samples == 4);
        // A ray more or less where a path decides differently.
        CHECK(double(twin.rays_extend) == Approx(double(floats.rays_extend)).epsilon(1e-3));
        CHECK(double(twin.rays_occlude) == Approx(double(floats.rays_occlude)).epsilon(1e-3));
        const twin::DoubleScene in_double(scene);
        const uint64_t bytes = in_double.memory_bytes() + twin::Tracer(in_double.view()).memory_bytes() +
                               3 * 8 * (24 * 16 * 3);  // the film's sums, those of squares, and the sample
        CHECK(twin.memory_bytes == bytes);
        CHECK(twin.memory_bytes_predicted == bytes);
        CHECK(twin.memory_bytes_peak == bytes);
        CHECK(twin.features == feature_names(kAllFeatures));
        CHECK(twin.build_seconds > 0);
        CHECK(twin.render_seconds > 0);
        CHECK(renderer->preferred_batch() >= 0.5 * 0.2 / twin.render_seconds);

        const FilmMoments first = renderer->film();
        renderer->clear_film();
        CHECK(renderer->film().samples == 0);
        REQUIRE(renderer->render(0, 4) == 4);
        CHECK(renderer->film().sum == first.sum);
        CHECK(renderer->film().sum_squares == first.sum_squares);
        CHECK(renderer->film().samples == 4);
        CHECK(renderer->stats().samples == 8);
        CHECK(renderer->stats().rays_extend == 2 * twin.rays_extend);
    }
}

TEST_CASE("Squares of the twin's samples are summed beside them", "[twin]") {
    const Scene scene = project_scene("cornell", 8, 8);
    const RenderSettings s = twin_settings(scene, "bdpt");
    const FilmMoments one = render_scene(scene, s, 1).film;
    bool lit = false;
    for (size_t i = 0; i < one.sum.size(); ++i) {
        CHECK(one.sum_squares[i] == one.sum[i] * one.sum[i]);
        lit |= one.sum[i] > 0 && one.sum[i] != 1;
    }
    CHECK(lit);
}

TEST_CASE("Light that is none is dropped by the twin and counted by what is wrong with it", "[twin]") {
    Scene scene = furnace("sphere", 1);
    const RenderSettings s = twin_settings(scene);
    REQUIRE(scene.emitters.size() == 1);
    const double seen = 4 * 8 * 8;
    const auto dropped = [&](Rgb radiance) {
        scene.emitters[0].radiance.value = radiance;
        const RenderResult r = render_scene(scene, s, 4);
        for (const double v : r.film.sum) CHECK(v == 0);
        return r.stats.invalid;
    };
    const float nan = std::nanf("");
    for (const Rgb wrong : {Rgb{nan, 1, 1}, Rgb{1, nan, 1}, Rgb{1, kInfinity, nan}}) {
        const InvalidCounts c = dropped(wrong);
        CHECK(double(c.nan) == seen);
        CHECK(c.inf + c.negative == 0);
    }
    for (const Rgb wrong : {Rgb{kInfinity, 1, 1}, Rgb{1, 1, -kInfinity}}) {
        const InvalidCounts c = dropped(wrong);
        CHECK(double(c.inf) == seen);
        CHECK(c.nan + c.negative == 0);
    }
    const InvalidCounts c = dropped({1, -1, 1});
    CHECK(double(c.negative) == seen);
    CHECK(c.nan + c.inf == 0);
}

TEST_CASE("What the twin does without is refused by name", "[twin]") {
    const Scene scene = project_scene("cornell", 8, 8);
    const auto refused = [&](const std::string& integrator, const std::string& key, const std::string& value,
                             const std::string& named) {
        RenderSettings s = twin_settings(scene, integrator);
        apply_setting(s, key, value);
        try {
            make_renderer(scene, s);
        } catch (const Error& e) {
            if (key == named && key != "backend")
                CHECK(std::string(e.what()) ==
                      key + "=" + value +
                          ": precision=double is a plain loop and does without; leave one of the two out");
            return e.code == ExitCode::usage && std::string(e.what()).find(named + "=") != std::string::npos;
        }
        return false;
    };
    CHECK(refused("path", "cull", "0.5", "cull"));
    CHECK(refused("bdpt", "technique_depth", "3", "technique_depth"));
    CHECK(refused("bdpt", "light_paths", "0.5", "light_paths"));
    CHECK(refused("bdpt", "bdpt.auto", "true", "bdpt.auto"));
    for (const char* variant : {"lvc", "streaming", "megakernel"})
        CHECK(refused("bdpt", "variant", variant, "precision"));
    CHECK(refused("path", "variant", "ris", "precision"));
    CHECK(refused("path", "backend", "cuda", "precision"));
    CHECK(refused("toy", "seed", "1", "precision"));
}
