// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Images of a camera of all directions: closed forms, and agreement of all methods, over the edges of the film too.
#include "tests/support/bidirectional_images.h"
#include "tests/support/spherical_scene.h"

using namespace ambilux;

namespace {

const std::vector<Method> kEach = methods_and("hits");

constexpr Rgb kAlbedo = {0.5f, 0.3f, 0.1f};

/// A sphere of albedo kAlbedo that shines inwards.
Scene furnace(const std::string& camera, int max_depth) {
    return scene_from_text(scene_xml(
        max_depth, camera +
                       "<shape type='sphere'><point name='center' x='0' y='-0.1' z='0.9'/><float name='radius' "
                       "value='2'/><boolean name='flip_normals' value='true'/>" +
                       diffuse(kAlbedo) + area_light(kLight) + "</shape>"));
}

/// kLight (1 + a + ... + a^(depth-1)) everywhere.
Image furnace_image(uint32_t width, uint32_t height, int depth) {
    Rgb sum = {0, 0, 0}, power = kLight;
    for (int i = 0; i < depth; ++i) sum += power, power *= kAlbedo;
    return constant_image(width, height, sum);
}

std::string crop_window(int x, int y, int width, int height) {
    const auto number = [](const char* name, int value) {
        return std::string("<integer name='crop_") + name + "' value='" + std::to_string(value) + "'/>";
    };
    return number("offset_x", x) + number("offset_y", y) + number("width", width) + number("height", height);
}

}  // namespace

TEST_CASE("inside of a sphere that shines every pixel has its radiance, by every method") {
    for (const char* filter : {"box", "gaussian"})
        for (const int depth : {1, 3}) {
            const Scene scene = furnace(spherical_camera(16, 8, filter), depth);
            REQUIRE(scene.features.latlong);
            const Image expected = furnace_image(16, 8, depth);
            check_all_estimators(scene, expected);
            uint64_t seed = 1;
            for (const Method& m : kEach) {
                INFO(filter << ", " << depth << " segments, " << m.name << ' ' << m.variant);
                check_image(scene, method_settings(scene, m, seed++), expected);
            }
        }
}

TEST_CASE("in a room path tracing, light tracing and all strategies agree, over the edges of film and crop too") {
    const std::vector<Method> methods(std::begin(kEach), std::begin(kEach) + 6);
    agree(scene_from_text(room_around(spherical_camera(16, 8, "gaussian"), 4)), methods, 1u << 12, 1u << 10, 0.08);
    // At the seam and a pole, in a film of few pixels: splats arrive from everywhere.
    for (const auto& [filter, crop] :
         {std::pair{"tent", crop_window(0, 0, 4, 4)}, {"gaussian", crop_window(4, 4, 4, 4)}}) {
        INFO(filter << ' ' << crop);
        const Scene scene = scene_from_text(room_around(spherical_camera(8, 8, filter, crop), 4));
        agree(scene, {kAll, kLightTracer}, 1u << 13, 1u << 13, 0.08);
    }
}

TEST_CASE("a film no higher than its filter holds the mean of all that is around") {
    const Scene scene = furnace(spherical_camera(8, 4, "gaussian"), 2);
    check_image(scene, method_settings(scene, kAll, 3), furnace_image(8, 4, 2));
    const Estimate light = render_batches(scene, method_settings(scene, kLightTracer, 3), 1u << 13);
    const Image expected = furnace_image(8, 4, 2);
    const auto mean_of = [](const auto& values) {
        double sum = 0;
        for (const auto value : values) sum += double(value);
        return sum / double(values.size());
    };
    double squares = 0;
    for (const std::vector<double>& batch : light.batches) squares += std::pow(mean_of(batch) - mean_of(light.mean), 2);
    const double error = std::sqrt(squares / (kBatches * (kBatches - 1.0)));
    INFO(mean_of(light.mean) << " +- " << error << ", expected " << mean_of(expected.rgb));
    CHECK(std::fabs(mean_of(light.mean) - mean_of(expected.rgb)) < 4.5 * error);
    CHECK(error < 0.01 * mean_of(expected.rgb));
}

TEST_CASE("the full set of kernels has the image of the level that a scene gets") {
    const Scene scene = scene_from_text(room_around(spherical_camera(16, 8, "gaussian"), 4));
    for (const char* integrator : {"path", "light", "bdpt"}) {
        RenderSettings s = cpu_settings(scene, Estimator::mis);
        s.integrator = integrator;
        const FilmMoments level = render_scene(scene, s, 4).film;
        s.specialise = false;
        const FilmMoments all = render_scene(scene, s, 4).film;
        for (size_t i = 0; i < all.sum.size(); ++i)
            CHECK(level.sum[i] == Approx(all.sum[i]).epsilon(1e-4).margin(1e-6));
    }
}
