// What is asked of methods whose iterations are whole (docs/architecture.md): that no thread, wave or budget decides a
// bit, and that a render goes on from its film, and from its state where it keeps one.
#pragma once

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "core/error.h"
#include "tests/support/render_scene.h"

namespace ambilux {

inline double mean_of(const FilmMoments& film) {
    double sum = 0;
    for (const double v : film.sum) sum += v;
    return sum / double(film.sum.size()) / double(film.samples);
}

/// On so many threads.
inline RenderResult render_on(int threads, const Scene& scene, const RenderSettings& s, uint32_t samples) {
    RenderResult result;
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, size_t(threads));
    tbb::task_arena arena(threads);
    arena.execute([&] { result = render_scene(scene, s, samples); });
    return result;
}

inline void check_same_bits(const RenderResult& a, const RenderResult& b) {
    CHECK(a.film.sum == b.film.sum);
    CHECK(a.film.sum_squares == b.film.sum_squares);
}

/// `part`: of the memory that a render takes, one in so many is withheld.
inline void check_bits_on_cpu(const Scene& scene, RenderSettings s, uint32_t samples, uint64_t part) {
    const RenderResult one = render_on(1, scene, s, samples);
    check_same_bits(render_on(2, scene, s, samples), one);
    check_same_bits(render_on(7, scene, s, samples), one);
    for (const uint32_t wave_size : {64u, 256u, 4096u}) {
        s.wave_size = wave_size;
        check_same_bits(render_on(2, scene, s, samples), one);
    }
    s.wave_size = 0;
    s.memory = one.stats.memory_bytes - one.stats.memory_bytes / part;
    check_same_bits(render_on(1, scene, s, samples), one);
}

/// The image of the CPU, whatever waves hold, and where there was too little room.
inline void check_on_device(const Scene& scene, RenderSettings s, uint32_t samples) {
    const double on_cpu = mean_of(render_scene(scene, s, samples).film);
    s.backend = "cuda";
    const RenderResult one = render_scene(scene, s, samples);
    CHECK(mean_of(one.film) == Approx(on_cpu).epsilon(2e-3));
    CHECK(one.stats.invalid.total() == 0);
    for (const uint32_t wave_size : {1024u, 4096u, 1u << 16}) {
        s.wave_size = wave_size;
        check_same_bits(render_scene(scene, s, samples), one);
    }
    s.wave_size = 0;
    s.graph = false;
    CHECK(render_scene(scene, s, samples).film.sum == one.film.sum);
}

/// `s` asks for iterations of four samples.
inline void check_resumes_from_film(const Scene& scene, const RenderSettings& s) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    CHECK(renderer->iteration_samples() == 4);
    CHECK(renderer->state_kind() == StateKind::by_index);
    CHECK_THROWS_AS(renderer->render(0, 6), Error);
    renderer->render(0, 8);
    const FilmMoments whole = renderer->film();
    std::vector<double> parts(whole.sum.size());
    for (const uint32_t first : {0u, 4u}) {
        const std::unique_ptr<Renderer> another = make_renderer(scene, s);
        another->render(first, 4);
        const FilmMoments film = another->film();
        for (size_t i = 0; i < parts.size(); ++i) parts[i] += film.sum[i];
    }
    for (size_t i = 0; i < parts.size(); ++i) CHECK(parts[i] == Approx(whole.sum[i]).epsilon(1e-12));
}

/// `s` asks for iterations of four samples; `one`: its image of twelve.
inline void check_resumes_from_state(const Scene& scene, const RenderSettings& s, const RenderResult& one) {
    const auto first = make_renderer(scene, s), second = make_renderer(scene, s);
    CHECK(first->iteration_samples() == 4);
    CHECK(first->state_kind() == StateKind::per_device);
    CHECK_THROWS_AS(first->render(0, 6), Error);
    first->render(0, 8);
    const std::vector<std::byte> saved = first->save_state();
    const FilmMoments before = first->film();
    second->load_state(saved);
    second->render(8, 4);
    FilmMoments whole = second->film();
    for (size_t i = 0; i < whole.sum.size(); ++i) whole.sum[i] += before.sum[i];
    for (size_t i = 0; i < whole.sum.size(); ++i) CHECK(whole.sum[i] == Approx(one.film.sum[i]).epsilon(1e-12));
    first->render(8, 4);
    CHECK(first->save_state() == second->save_state());
    CHECK(first->film().sum == one.film.sum);
}

}  // namespace ambilux
