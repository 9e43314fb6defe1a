// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: gpu
// Iterations of a device: the same films as a plain loop over all marks, to the bit, as on a host (test_phases).
#include "accel/shared_accels.h"
#include "core/error.h"
#include "integrators/feature_levels.h"
#include "render/cuda_backend.cuh"
#include "render/wave_renderer.h"
#include "tests/support/gpu_device.h"
#include "tests/support/mark_film.h"
#include "tests/support/render_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// With splats and a state that learns; without, and a state that follows from the number of the iteration.
using Learning = MarkIntegrator<kDiffuseFeatures, CwbvhTracer, true, true>;
using Numbered = MarkIntegrator<kDiffuseFeatures, CwbvhTracer, false, false>;

constexpr uint32_t kSlots = 9 * 5 * kTilePixels;
const Scene& scene() {
    static const Scene s = project_scene("cornell", 70, 38);
    return s;
}

template <class Integrator>
std::unique_ptr<Renderer> make(const RenderSettings& settings) {
    SharedAccels accels(scene());
    return std::make_unique<WaveRenderer<CudaBackend<Integrator, kDiffuseFeatures>, Integrator, kDiffuseFeatures>>(
        scene(), settings, accels);
}

uint64_t items(const RenderStats& stats, const std::string& stage) {
    uint64_t n = 0;
    for (const StageStats& s : stats.stages)
        if (s.name == stage) n += s.items;
    return n;
}
QueueStats queue(const RenderStats& stats, const std::string& name) {
    for (const QueueStats& q : stats.queues)
        if (q.name == name) return q;
    FAIL("no queue " << name);
    return {};
}

template <class Integrator>
RenderStats check_film(const RenderSettings& settings, uint32_t samples) {
    const std::unique_ptr<Renderer> renderer = make<Integrator>(settings);
    REQUIRE(renderer->render(0, samples) == samples);
    const RenderStats stats = renderer->stats();
    CHECK(renderer->film().sum == mark_film(70, 38, settings, samples, std::is_same_v<Integrator, Learning>).sum);
    CHECK(stats.invalid.total() == 0);
    for (const QueueStats& q : stats.queues) {
        INFO(q.name);
        CHECK(q.overflow == 0);
        CHECK(q.peak <= q.capacity);
    }
    return stats;
}

}  // namespace

TEST_CASE("two phases on a device: a plain loop over all marks, for any waves and room, in graphs and without") {
    if (!device()) return;
    for (const bool graph : {true, false})
        for (const uint32_t samples : {1u, 3u})
            for (const char* room : {"0", "3000", "20000"}) {
                INFO(samples << " samples an iteration, room for " << room << " marks, graph " << graph);
                RenderSettings s = mark_settings({{"iteration_samples", std::to_string(samples)}, {"room", room}});
                s.graph = graph;
                check_film<Learning>(s, 6);
                for (const uint32_t wave_size : {64u, 448u, 0u}) {
                    INFO("waves of " << wave_size);
                    s.wave_size = wave_size;
                    check_film<Numbered>(s, 6);
                }
            }
}

TEST_CASE("a wave on a device that has no room among what all append is done again, and counts once") {
    if (!device()) return;
    for (const uint32_t tile : {0u, 22u, 44u})
        for (const uint32_t iteration : {0u, 1u}) {
            INFO("tile " << tile << " of iteration " << iteration);
            std::map<std::string, std::string> own = {{"heavy_tile", std::to_string(tile)},
                                                      {"heavy_iteration", std::to_string(iteration)}};
            const MarkCounts n = mark_counts(70, 38, mark_settings(own), iteration),
                             other = mark_counts(70, 38, mark_settings(own), 1 - iteration);
            own["room"] = std::to_string(std::max(n.all - n.heavy_wave, other.all) - 64);
            RenderSettings s = mark_settings(own);
            s.wave_size = kTilePixels;
            const RenderStats stats = check_film<Numbered>(s, 3);
            CHECK(items(stats, "leave_marks") == 3 * kSlots + kTilePixels);
            CHECK(items(stats, "append_marks") == n.all + other.all + mark_counts(70, 38, s, 2).all);
            CHECK(items(stats, "gather_marks") == 3 * kSlots);
            CHECK(queue(stats, "marks").capacity > n.all);
            CHECK(queue(stats, "marks").peak == n.all);
            s.wave_size = 0;
            CHECK(items(check_film<Learning>(s, 3), "splat") == 3 * 70 * 38);
        }
}

TEST_CASE("a budget of a device divides the film into waves that have the same bits") {
    if (!device()) return;
    for (const char* room : {"20000", "30000"}) {
        RenderSettings s = mark_settings({{"room", room}, {"iteration_samples", "2"}});
        s.memory = make<Learning>(s)->stats().memory_bytes_predicted + (1 << 20);  // and an image
        CHECK(check_film<Learning>(s, 4).wave_paths == 2 * kSlots);
        // Most of a wave are queues of marks, kMostMarks of a slot.
        s.memory -= kSlots * kMostMarks * sizeof(Mark);
        const RenderStats divided = check_film<Learning>(s, 4);
        CHECK(divided.wave_paths < 2 * kSlots);
        CHECK(divided.memory_bytes_peak <= s.memory);
        CHECK(items(divided, "splat") == 4 * 70 * 38);
    }
}

TEST_CASE("killed and resumed on a device: a state that learns goes on from what was saved") {
    if (!device()) return;
    const RenderSettings s = mark_settings({{"iteration_samples", "2"}});
    const FilmMoments whole = mark_film(70, 38, s, 8, true), half = mark_film(70, 38, s, 4, true);
    std::vector<std::byte> saved;
    {
        const std::unique_ptr<Renderer> first = make<Learning>(s);
        CHECK_THROWS_AS(first->render(0, 3), Error);
        first->render(0, 4);
        CHECK(first->film().sum == half.sum);
        saved = first->save_state();
    }
    const std::unique_ptr<Renderer> second = make<Learning>(s);
    second->load_state(saved);
    CHECK(second->save_state() == saved);
    second->render(4, 4);
    std::vector<double> sum = second->film().sum;
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += half.sum[i];
    CHECK(sum == whole.sum);
}
