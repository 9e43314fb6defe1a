// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// A renderer that begins anew with another camera, gives up what nobody waits for, and shows 8 bits.
#include "core/flag.h"
#include "tests/support/moved_camera.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const char* integrator, const char* variant) {
    RenderSettings s;
    s.backend = "cpu";
    s.integrator = integrator;
    s.variant = variant;
    return s;
}

}  // namespace

TEST_CASE("a renderer whose camera moved is one that was made there") {
    for (const auto& [integrator, variant] :
         {std::pair{"path", "wavefront"}, {"light", "wavefront"}, {"bdpt", "wavefront"}, {"bdpt", "lvc"}}) {
        INFO(integrator << " " << variant);
        Scene scene = project_scene("glass", 40, 30);
        const MovedCamera m = move_camera(scene, settings_of(integrator, variant));
        REQUIRE(m.moved);
        CHECK(m.film.samples == 4);
        CHECK(m.film.sum == m.of_a_new_one.sum);
        CHECK(m.film.sum_squares == m.of_a_new_one.sum_squares);
        CHECK(m.stats.samples == 4);
        CHECK(m.stats.rays_extend == m.of_new_stats.rays_extend);
        CHECK(m.stats.memory_bytes == m.of_new_stats.memory_bytes);
    }
}

TEST_CASE("a method that keeps a state takes another renderer for another camera") {
    Scene scene = project_scene("cornell", 16, 12);
    CHECK_FALSE(move_camera(scene, settings_of("vcm", "wavefront")).moved);
}

TEST_CASE("a sample that is given up is lost, until the camera moves") {
    Scene scene = project_scene("cornell", 64, 48);
    for (const char* integrator : {"path", "bdpt"}) {
        SharedAccels accels(scene);
        const auto renderer = make_renderer(scene, settings_of(integrator, "wavefront"), accels);
        volatile bool flag = false;
        renderer->give_up_when(&flag);
        REQUIRE(renderer->render(0, 2) == 2);
        set_flag(&flag);
        CHECK(renderer->render(2, 2) == 0);
        CHECK_THROWS_AS(renderer->film(), Error);
        CHECK_THROWS_AS(renderer->picture(0), Error);
        flag = false;
        REQUIRE(renderer->move_camera());
        REQUIRE(renderer->render(0, 2) == 2);
        CHECK(renderer->film().sum == [&] {
            const auto other = make_renderer(scene, settings_of(integrator, "wavefront"), accels);
            other->render(0, 2);
            return other->film().sum;
        }());
    }
}

TEST_CASE("a picture is the image in 8 bits of sRGB") {
    const Scene scene = project_scene("glass", 33, 21);
    const auto renderer = make_renderer(scene, settings_of("path", "wavefront"));
    check_picture(*renderer, 0);  // of no samples: black
    renderer->render(0, 4);
    for (const float stops : {0.0f, 2.5f, -3.0f}) check_picture(*renderer, stops);
}

TEST_CASE("what is no number is shown black, and what is brighter than white is white") {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    const double sum[6] = {nan, inf, -1, 1e300, 0, 2};
    const ByteImage image = tone_mapped(sum, 2, 1, 2, 0);
    const std::vector<int> shown(image.rgb.get(), image.rgb.get() + image.bytes());
    CHECK(shown == std::vector<int>{0, 255, 0, 255, 0, 255});
}
