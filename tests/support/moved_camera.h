// What a renderer shows, and how it begins anew with another camera.
#pragma once

#include <cmath>

#include "core/error.h"
#include "core/srgb.h"
#include "render/shared_renderer.h"
#include "tests/support/catch.h"
#include "tests/support/film_difference.h"
#include "tests/support/render_scene.h"

namespace ambilux {

struct MovedCamera {
    bool moved = false;
    FilmMoments film, of_a_new_one;
    RenderStats stats, of_new_stats;
};

inline void push_camera(Scene& scene, float by) {
    for (int axis = 0; axis < 3; ++axis)
        scene.sensor.to_world.m[axis][3] += by * scene.bounds_radius * scene.sensor.to_world.m[axis][2];
}

/// Five samples from somewhere, then four from somewhere else, and those of a renderer that was never elsewhere.
inline MovedCamera move_camera(Scene& scene, const RenderSettings& settings) {
    SharedAccels accels(scene);
    const auto renderer = make_renderer(scene, settings, accels);
    const uint32_t k = renderer->iteration_samples();
    renderer->render(0, 5 * k);
    push_camera(scene, 0.1f);
    MovedCamera result;
    result.moved = renderer->move_camera();
    const auto other = make_renderer(scene, settings, accels);
    for (const auto* r : {&renderer, &other}) {
        REQUIRE((*r)->render(0, 3 * k) == 3 * k);
        REQUIRE((*r)->render(3 * k, k) == k);
    }
    result.film = renderer->film();
    result.stats = renderer->stats();
    result.of_a_new_one = other->film();
    result.of_new_stats = other->stats();
    return result;
}

/// What is shown is the image in sRGB of 8 bits, up to the last one.
inline void check_picture(Renderer& renderer, float stops) {
    const FilmMoments film = renderer.film();
    const ByteImage picture = renderer.picture(stops);
    REQUIRE(picture.width == film.width);
    REQUIRE(picture.height == film.height);
    REQUIRE(picture.samples == film.samples);
    int worst = 0;
    for (size_t i = 0; i < film.sum.size(); ++i) {
        const float shown = 255.0f * linear_to_srgb(float(film.mean(i)) * std::exp2(stops));
        worst = std::max(worst, std::abs(int(std::lround(shown)) - int(picture.rgb.get()[i])));
    }
    CHECK(worst <= 1);
}

}  // namespace ambilux
