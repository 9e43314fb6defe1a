// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 5
// Iterations of a host: phases, work between them, growth, budgets and states, against a plain loop over all marks.
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "accel/shared_accels.h"
#include "core/error.h"
#include "integrators/feature_levels.h"
#include "integrators/parse_value.h"
#include "render/cpu_backend.h"
#include "render/wave_renderer.h"
#include "tests/support/mark_film.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// With splats and a state that learns; without, and a state that follows from the number of the iteration.
using Learning = MarkIntegrator<kDiffuseFeatures, HostTracer, true, true>;
using Numbered = MarkIntegrator<kDiffuseFeatures, HostTracer, false, false>;

/// 9 x 5 tiles, of which those at the right and the bottom are cut.
const Scene& scene() {
    static const Scene s = project_scene("cornell", 70, 38);
    return s;
}

template <class Integrator>
std::unique_ptr<Renderer> make(const RenderSettings& settings, const Scene& of = scene()) {
    SharedAccels accels(of);
    return std::make_unique<WaveRenderer<CpuBackend<Integrator, kDiffuseFeatures>, Integrator, kDiffuseFeatures>>(
        of, settings, accels);
}

const StageStats& stage(const RenderStats& stats, const std::string& name) {
    for (const StageStats& s : stats.stages)
        if (s.name == name) return s;
    FAIL("no stage " << name);
    return stats.stages[0];
}
const QueueStats& queue(const RenderStats& stats, const std::string& name) {
    for (const QueueStats& q : stats.queues)
        if (q.name == name) return q;
    FAIL("no queue " << name);
    return stats.queues[0];
}

/// f() on so many threads, and as many workers as that takes.
template <class Function>
void on_threads(int threads, const Function& f) {
    const tbb::global_control most(tbb::global_control::max_allowed_parallelism, 8);
    tbb::task_arena arena(threads);
    arena.execute(f);
}

/// Renders `samples` and compares the film with that of the plain loop, to the bit.
template <class Some>
RenderStats check_film(int threads, const RenderSettings& settings, uint32_t samples) {
    RenderStats stats;
    on_threads(threads, [&] {
        const std::unique_ptr<Renderer> renderer = make<Some>(settings);
        REQUIRE(renderer->render(0, samples) == samples);
        stats = renderer->stats();
        const FilmMoments film = renderer->film();
        CHECK(film.sum == mark_film(film.width, film.height, settings, samples, std::is_same_v<Some, Learning>).sum);
    });
    CHECK(stats.device == "CPU, " + std::to_string(threads) + " threads");
    CHECK(stats.invalid.total() == 0);
    for (const QueueStats& q : stats.queues) {
        INFO(q.name);
        CHECK(q.overflow == 0);
        CHECK(q.peak <= q.capacity);
    }
    return stats;
}

}  // namespace

TEST_CASE(
    "two phases, sorts and sums between them: a plain loop over all marks, on any threads and waves, in any room") {
    for (const uint32_t samples : {1u, 3u})
        for (const char* room : {"0", "3000", "20000"})
            for (const int threads : {1, 2, 7})
                for (const uint32_t wave_size : {64u, 128u, 0u}) {
                    RenderSettings s = mark_settings({{"iteration_samples", std::to_string(samples)}, {"room", room}});
                    s.wave_size = wave_size;
                    INFO(samples << " samples an iteration, room for " << room << " marks, " << threads
                                 << " threads, waves of " << wave_size);
                    const RenderStats learning = check_film<Learning>(threads, s, 6);
                    check_film<Numbered>(threads, s, 6);
                    // At least eight waves in a phase.
                    CHECK(stage(learning, "gather_marks").launches >= 8 * 6);
                }
}

TEST_CASE("a wave that has no room among what all append is done again, alone, and counts once") {
    for (const uint32_t samples : {1u, 2u})
        for (const uint32_t tile : {0u, 22u, 44u})
            for (const uint32_t heavy_sample : {0u, samples - 1})
                for (const uint32_t iteration : {0u, 1u}) {
                    INFO(samples << " samples an iteration, tile " << tile << ", sample " << heavy_sample
                                 << " of iteration " << iteration);
                    std::map<std::string, std::string> own = {{"iteration_samples", std::to_string(samples)},
                                                              {"heavy_tile", std::to_string(tile)},
                                                              {"heavy_sample", std::to_string(heavy_sample)},
                                                              {"heavy_iteration", std::to_string(iteration)}};
                    // All marks but those of the one wave find room, and so no other wave fails.
                    const MarkCounts n = mark_counts(70, 38, mark_settings(own), iteration),
                                     before = mark_counts(70, 38, mark_settings(own), 1 - iteration);
                    const uint32_t room = std::max(n.all - n.heavy_wave, before.all);
                    REQUIRE(n.heavy_wave > room - (n.all - n.heavy_wave) + n.after);
                    own["room"] = std::to_string(room - 64);
                    RenderSettings s = mark_settings(own);
                    s.wave_size = kTilePixels;
                    const uint32_t slots = 45 * kTilePixels;
                    const auto check = [&](const RenderStats& stats) {
                        CHECK(stage(stats, "leave_marks").items == 3 * samples * slots + kTilePixels);
                        CHECK(stage(stats, "append_marks").items ==
                              n.all + mark_counts(70, 38, s, 1 - iteration).all + mark_counts(70, 38, s, 2).all);
                        CHECK(stage(stats, "gather_marks").items == 3 * samples * slots);
                        CHECK(queue(stats, "marks").capacity > n.all);
                        CHECK(queue(stats, "marks").peak == n.all);
                    };
                    const RenderStats learning = check_film<Learning>(1, s, 3 * samples);
                    check(learning);
                    CHECK(stage(learning, "splat").items == 3 * samples * 70 * 38);
                    check(check_film<Numbered>(1, s, 3 * samples));
                    // Where waves run side by side others may fail instead.
                    check_film<Learning>(2, s, 3 * samples);
                    check_film<Learning>(7, s, 3 * samples);
                }
}

TEST_CASE(
    "a budget that has no room for a wave's queues divides the wave; one that has none for the state is refused") {
    RenderSettings s = mark_settings({{"room", "10000"}, {"wave_room", "140"}});
    const auto predicted = [&] { return make<Learning>(s)->stats().memory_bytes_predicted; };
    for (const int threads : {1, 2}) {
        INFO(threads << " threads");
        s.memory = 0;
        s.wave_size = 512;
        const RenderStats free = check_film<Learning>(threads, s, 4);
        uint64_t least = 0;
        on_threads(threads, [&] { least = predicted(); });
        s.memory = least;
        const RenderStats divided = check_film<Learning>(threads, s, 4);
        CHECK(divided.memory_bytes_peak == least);
        CHECK(queue(divided, "wave_marks").capacity == 204);
        if (threads == 1) {
            CHECK(queue(free, "wave_marks").capacity > 204);
            CHECK(stage(divided, "append_marks").launches > stage(free, "append_marks").launches);
        }
        CHECK(stage(divided, "append_marks").items == stage(free, "append_marks").items);
        CHECK(stage(divided, "splat").items == 4 * 70 * 38);
    }
    s = mark_settings({});
    Scene heavy = scene();
    heavy.texels.resize(5 << 20);
    heavy.vertices.resize(heavy.vertices.size() + (3 << 20) / sizeof(MeshVertex));
    on_threads(1, [&] {
        s.memory = make<Learning>(s, heavy)->stats().memory_bytes_predicted;
        // Film and state take less than a MiB.
        CHECK_THROWS_WITH(make<Learning>(s, heavy)->render(0, 1),
                          StartsWith("memory=" + text_of_bytes(s.memory) + ": this render needs at least ") &&
                              ContainsSubstring(": 4 of geometry, 5 of textures, ") &&
                              ContainsSubstring(" structure, 1 of the rest of the scene, 1 of film, "));
    });
}

TEST_CASE("renders begin and end with whole iterations, interrupted or not") {
    const RenderSettings s = mark_settings({{"iteration_samples", "3"}});
    const std::unique_ptr<Renderer> renderer = make<Learning>(s);
    CHECK(renderer->iteration_samples() == 3);
    for (const auto& [first, count] : {std::pair{0u, 4u}, {1u, 3u}, {2u, 2u}})
        CHECK_THROWS_AS(renderer->render(first, count), Error);
    volatile bool stop = true;
    CHECK(renderer->render(0, 30, &stop) == 0);
    stop = false;
    std::thread clock([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        stop = true;
    });
    const uint32_t done = renderer->render(0, 30'000, &stop);
    clock.join();
    CHECK(done % 3 == 0);
    CHECK(done < 30'000);
    CHECK(renderer->film().sum == mark_film(70, 38, s, done, true).sum);
}

TEST_CASE("waves of a method of one phase do not reach over two iterations where its state follows from their number") {
    const Scene small = project_scene("cornell", 8, 8);
    RenderSettings s = mark_settings({{"iteration_samples", "3"}});
    s.wave_size = 16 * kTilePixels;
    const std::unique_ptr<Renderer> renderer = make<NumberIntegrator<kDiffuseFeatures, HostTracer>>(s, small);
    CHECK(renderer->iteration_samples() == 3);
    REQUIRE(renderer->render(0, 3) == 3);
    REQUIRE(renderer->render(3, 9) == 9);
    for (const double sum : renderer->film().sum) CHECK(sum == 3 * (0 + 1 + 2 + 3));
}

TEST_CASE("killed and resumed: a state that learns goes on from what was saved, one by number from nothing") {
    const RenderSettings s = mark_settings({{"iteration_samples", "2"}});
    const FilmMoments whole = mark_film(70, 38, s, 8, true), half = mark_film(70, 38, s, 4, true);
    std::vector<std::byte> saved;
    {
        const std::unique_ptr<Renderer> first = make<Learning>(s);
        CHECK(first->state_kind() == StateKind::per_device);
        first->render(0, 4);
        CHECK(first->film().sum == half.sum);
        saved = first->save_state();
    }
    const auto rest = [&](bool load) {
        const std::unique_ptr<Renderer> second = make<Learning>(s);
        if (load) {
            second->load_state(saved);
            CHECK(second->save_state() == saved);
        }
        second->render(4, 4);
        std::vector<double> sum = second->film().sum;
        for (size_t i = 0; i < sum.size(); ++i) sum[i] += half.sum[i];
        return sum;
    };
    CHECK(rest(true) == whole.sum);
    CHECK(rest(false) != whole.sum);

    const FilmMoments numbered = mark_film(70, 38, s, 8, false);
    std::vector<double> sum(numbered.sum.size());
    for (const uint32_t first : {4u, 0u}) {
        const std::unique_ptr<Renderer> renderer = make<Numbered>(s);
        CHECK(renderer->state_kind() == StateKind::by_index);
        CHECK(renderer->save_state().empty());
        renderer->load_state({});
        renderer->render(first, 4);
        const FilmMoments film = renderer->film();
        for (size_t i = 0; i < sum.size(); ++i) sum[i] += film.sum[i];
    }
    CHECK(sum == numbered.sum);
}

TEST_CASE("a saved state that does not fit is refused by name") {
    const RenderSettings s = mark_settings({});
    const std::unique_ptr<Renderer> renderer = make<Learning>(s);
    renderer->render(0, 1);
    const std::vector<std::byte> saved = renderer->save_state();
    // Of each array: letters of its name, the name, bytes, the bytes.
    REQUIRE(saved.size() == 8 + 7 + 8 + kBins * 4 + 8 + 10 + 8 + 8);
    const auto refusal = [&](std::vector<std::byte> bytes) -> std::string {
        try {
            make<Learning>(s)->load_state(bytes);
        } catch (const Error& e) {
            CHECK(e.code == ExitCode::bad_input);
            return e.what();
        }
        return "";
    };
    CHECK(refusal(saved) == "");
    for (size_t n = 0; n < saved.size(); ++n) {
        INFO(n << " bytes");
        CHECK_THAT(refusal({saved.begin(), saved.begin() + std::ptrdiff_t(n)}),
                   StartsWith("saved state: it ends within ") &&
                       ContainsSubstring(n < 8 + 7 + 8 + kBins * 4 ? "learned" : "iterations"));
    }
    const auto changed = [&](size_t at, std::byte value) {
        std::vector<std::byte> bytes = saved;
        bytes[at] = value;
        return refusal(bytes);
    };
    CHECK_THAT(changed(8, std::byte('x')), ContainsSubstring("'xearned'") && ContainsSubstring("'learned'"));
    CHECK_THAT(changed(15, std::byte(kBins * 4 - 4)), ContainsSubstring(std::to_string(kBins * 4 - 4)));
    for (const size_t letters : {0u, 7u})  // more than there are, few and many
        CHECK_THAT(changed(letters, std::byte(0xff)), ContainsSubstring("learned"));
    std::vector<std::byte> longer = saved;
    longer.push_back(std::byte(0));
    CHECK_THAT(refusal(longer), ContainsSubstring("there is more"));
    const std::unique_ptr<Renderer> other = make<Numbered>(s);
    CHECK_THROWS_WITH(other->load_state(saved), ContainsSubstring("there is more"));
}
