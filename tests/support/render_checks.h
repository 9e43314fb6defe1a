// Checks that hold for a render by any integrator.
#pragma once

#include <algorithm>
#include <chrono>
#include <thread>

#include "core/flag.h"
#include "tests/support/render_scene.h"

namespace ambilux {

/// The same bits.
inline bool same_image(const FilmMoments& a, const FilmMoments& b) {
    return a.samples == b.samples && a.sum == b.sum && a.sum_squares == b.sum_squares;
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
