// Checks that hold for a render by any integrator.
#pragma once

#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "core/flag.h"
#include "tests/support/render_scene.h"

namespace ambilux {

/// The same bits.
inline bool same_image(const FilmMoments& a, const FilmMoments& b) {
    return a.samples == b.samples && a.sum == b.sum && a.sum_squares == b.sum_squares;
}

/// The image does not depend on the size of waves, on batches of samples or on the number of threads.
inline FilmMoments check_one_image(const Scene& scene, const RenderSettings& settings, uint32_t samples,
                                   const std::vector<uint32_t>& wave_sizes) {
    const FilmMoments film = render_scene(scene, settings, samples).film;
    CHECK(same_image(film, render_scene(scene, settings, samples).film));
    for (uint32_t wave_size : wave_sizes) {
        INFO("wave_size " << wave_size);
        RenderSettings s = settings;
        s.wave_size = wave_size;
        CHECK(same_image(film, render_scene(scene, s, samples).film));
    }
    const uint32_t first = (samples + 1) / 3;
    const std::unique_ptr<Renderer> parts = make_renderer(scene, settings);
    CHECK(parts->render(0, first) == first);
    CHECK(parts->render(first, samples - first) == samples - first);
    CHECK(same_image(film, parts->film()));
    parts->clear_film();
    CHECK(parts->film().samples == 0);
    CHECK(parts->render(0, samples) == samples);
    CHECK(same_image(film, parts->film()));
    for (size_t threads : {1u, 2u}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        INFO(threads << " threads");
        CHECK(same_image(film, render_scene(scene, settings, samples).film));
    }
    return film;
}

/// An interrupted render holds exactly the samples that it says: none if it was interrupted before, and else those of a
/// render of so many.
inline void check_interrupted(const Scene& scene, const RenderSettings& settings) {
    volatile bool stop = true;
    const std::unique_ptr<Renderer> never = make_renderer(scene, settings);
    CHECK(never->render(0, 100, &stop) == 0);
    CHECK(never->film().samples == 0);
    const FilmMoments empty = never->film();
    CHECK(std::all_of(empty.sum.begin(), empty.sum.end(), [](double v) { return v == 0; }));

    // Interrupted by another thread somewhere on the way.
    const std::unique_ptr<Renderer> some = make_renderer(scene, settings);
    stop = false;
    std::thread alarm([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        set_flag(&stop);
    });
    const uint32_t done = some->render(0, 1u << 30, &stop);
    alarm.join();
    REQUIRE(done > 0);
    CHECK(some->film().samples == done);
    CHECK(some->stats().samples == done);
    CHECK(same_image(some->film(), render_scene(scene, settings, done).film));
}

}  // namespace ambilux
