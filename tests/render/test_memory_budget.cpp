// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// The setting memory: what a render allocates stays below it, whatever it renders, and its image is the same.
#include <malloc.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "accel/shared_accels.h"
#include "core/error.h"
#include "integrators/parse_value.h"
#include "integrators/registry.h"
#include "render/shared_renderer.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/caught_subpaths.h"

using namespace ambilux;

namespace {

/// Bytes that operator new gave and that were not given back, and the most of them.
std::atomic<int64_t> held{0}, most{0};

void* counted(void* p) {
    if (!p) throw std::bad_alloc();
    const int64_t now = held += int64_t(malloc_usable_size(p));
    for (int64_t before = most; before < now && !most.compare_exchange_weak(before, now);) {}
    return p;
}
void give_back(void* p) noexcept {
    if (p) held -= int64_t(malloc_usable_size(p));
    std::free(p);
}

}  // namespace

void* operator new(size_t n) { return counted(std::malloc(n)); }
void* operator new[](size_t n) { return counted(std::malloc(n)); }
// std::stable_sort asks this way.
void* operator new(size_t n, const std::nothrow_t&) noexcept {
    void* const p = std::malloc(n);
    return p ? counted(p) : nullptr;
}
void* operator new(size_t n, std::align_val_t a) {
    return counted(std::aligned_alloc(size_t(a), (n + size_t(a) - 1) / size_t(a) * size_t(a)));
}
void* operator new[](size_t n, std::align_val_t a) { return operator new(n, a); }
void operator delete(void* p) noexcept { give_back(p); }
void operator delete[](void* p) noexcept { give_back(p); }
void operator delete(void* p, size_t) noexcept { give_back(p); }
void operator delete[](void* p, size_t) noexcept { give_back(p); }
void operator delete(void* p, std::align_val_t) noexcept { give_back(p); }
void operator delete[](void* p, std::align_val_t) noexcept { give_back(p); }
void operator delete(void* p, size_t, std::align_val_t) noexcept { give_back(p); }
void operator delete[](void* p, size_t, std::align_val_t) noexcept { give_back(p); }

namespace {

RenderSettings settings_of(const Scene& scene, const Variant& variant) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = variant.integrator;
    s.variant = variant.variant;
    return s;
}

/// A film so many times as high has as many tiles for a thread as on two: waves that can be made smaller.
uint32_t pairs_of_threads() { return uint32_t(tbb::task_arena().max_concurrency() + 1) / 2; }

/// The least that this render needs: with waves of one tile. Of one acceleration structure, lest its size differ.
uint64_t least_bytes(const Scene& scene, RenderSettings s, SharedAccels& accels) {
    s.memory = 0;
    s.wave_size = kTilePixels;
    return make_renderer(scene, s, accels)->stats().memory_bytes_predicted;
}

/// What a renderer takes while it is made and while it renders `spp`, or the next whole iterations, in its own count
/// and by operator new.
RenderResult render_counted(const Scene& scene, const RenderSettings& s, uint32_t spp, SharedAccels& accels) {
    // Names, records, tasks of the scheduler, the pilot's vectors: what is not counted.
    constexpr int64_t kSmall = 1 << 20;
    const int64_t before = held;
    most = before;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s, accels);
    const uint32_t iteration = renderer->iteration_samples(), samples = (spp + iteration - 1) / iteration * iteration;
    REQUIRE(renderer->render(0, samples) == samples);
    const int64_t taken = most - before;
    const RenderStats stats = renderer->stats();
    CHECK(stats.memory_bytes == stats.memory_bytes_predicted);
    CHECK(stats.memory_bytes_peak >= stats.memory_bytes);
    if (s.memory) CHECK(stats.memory_bytes_peak <= s.memory);
    CHECK(taken <= int64_t(stats.memory_bytes_peak) + kSmall);
    for (const QueueStats& q : stats.queues) CHECK(q.overflow == 0);
    return {renderer->film(), stats};
}

std::string refusal(const Scene& scene, const RenderSettings& s, SharedAccels& accels) {
    try {
        make_renderer(scene, s, accels);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::device);
        return e.what();
    }
    FAIL("not refused");
    return "";
}

}  // namespace

TEST_CASE("bytes are read with their unit and printed with the largest that divides them") {
    for (const auto& [text, bytes, printed] : {std::tuple{"1", uint64_t(1), "1"},
                                               {"1024", uint64_t(1024), "1K"},
                                               {"1536M", uint64_t(1536) << 20, "1536M"},
                                               {"4096M", uint64_t(4) << 30, "4G"},
                                               {"2T", uint64_t(2) << 40, "2T"}}) {
        CHECK(parse_bytes("memory", text) == bytes);
        CHECK(text_of_bytes(bytes) == printed);
    }
    for (const char* wrong : {"", "0", "G", "4g", "4GB", "-1", "1.5G", "99999999999T", "18446744073709551616"})
        CHECK_THROWS_AS(parse_bytes("memory", wrong), Error);
    RenderSettings s;
    try {
        apply_setting(s, "memory", "host");
        FAIL("accepted");
    } catch (const Error& e) {
        CHECK(std::string(e.what()).find("the setting textures") != std::string::npos);
    }
}

TEST_CASE("1920x1080 within 256 MiB, 1 GiB and 4 GiB, of all integrators and variants on the CPU") {
    const Scene scene = project_scene("cornell", 1920, 1080), small = project_scene("cornell", 16, 16);
    SharedAccels accels(scene);
    for (const Variant& variant : variants()) {
        // Such a state holds what an iteration of the whole film leaves.
        if (make_renderer(small, settings_of(small, variant))->state_kind() == StateKind::by_index) continue;
        for (const char* memory : {"256M", "1G", "4G"}) {
            CAPTURE(variant.name(), memory);
            RenderSettings s = settings_of(scene, variant);
            apply_setting(s, "memory", memory);
            render_counted(scene, s, 0, accels);  // all is there before the first sample
        }
    }
}

TEST_CASE("the least budget renders, one byte less is refused with the bytes of each part") {
    const Scene scene = project_scene("materials", 96, 64 * pairs_of_threads());
    SharedAccels accels(scene);
    for (const Variant& variant : variants()) {
        CAPTURE(variant.name());
        RenderSettings s = settings_of(scene, variant);
        s.memory = least_bytes(scene, s, accels);
        render_counted(scene, s, 1, accels);
        --s.memory;
        const std::string message = refusal(scene, s, accels);
        INFO(message);
        CHECK(message.find("memory=" + text_of_bytes(s.memory) + ": ") == 0);
        CHECK(message.find(" at least " + std::to_string((s.memory >> 20) + 1) + "M: ") != std::string::npos);
        for (const char* part : {"geometry", "textures", "acceleration structure", "film", "waves"})
            CHECK(message.find(part) != std::string::npos);
        s.memory = least_bytes(scene, s, accels);
        s.wave_size = 4096;  // what was set is not made smaller
        CHECK(refusal(scene, s, accels).find("4096 paths") != std::string::npos);
    }
}

TEST_CASE("a budget changes no bit of a path tracer, nor of paired subpaths on the CPU") {
    const Scene scene = project_scene("materials", 96, 64);
    SharedAccels accels(scene);
    for (const auto& [integrator, variant] :
         {std::pair{"path", "wavefront"}, {"bdpt", "wavefront"}, {"bdpt", "streaming"}}) {
        CAPTURE(integrator, variant);
        RenderSettings s = settings_of(scene, *find_variant(integrator, variant));
        const RenderResult any = render_counted(scene, s, 4, accels);
        s.memory = least_bytes(scene, s, accels);
        const RenderResult least = render_counted(scene, s, 4, accels);
        // Many threads have waves of a tile each without a budget.
        if (any.stats.wave_paths > kTilePixels) CHECK(least.stats.memory_bytes < any.stats.memory_bytes);
        CHECK(bool(least.film.sum == any.film.sum));
        CHECK(bool(least.film.sum_squares == any.film.sum_squares));
    }
}

TEST_CASE("a budget does not change the expectation of bidirectional variants") {
    const Scene scene = project_scene("materials", 32, 24);
    SharedAccels accels(scene);
    RenderSettings reference = settings_of(scene, *find_variant("bdpt", "wavefront"));
    reference.seed = 5;
    const Estimate expected = render_batches(scene, reference, 256);
    for (const char* variant : {"wavefront", "lvc"}) {
        RenderSettings s = settings_of(scene, *find_variant("bdpt", variant));
        s.memory = least_bytes(scene, s, accels);
        const ZTestResult result = z_test(render_batches(scene, s, 256), expected);
        INFO(variant << "\n" << result.report());
        CHECK(result.pass);
    }
}

TEST_CASE("more light vertices than were planned for: waves are divided where the budget has no room for them") {
    const Scene scene = scene_of_caught_subpaths(128 * pairs_of_threads());
    SharedAccels accels(scene);
    for (const char* variant : {"wavefront", "lvc"}) {
        CAPTURE(variant);
        RenderSettings s = settings_of(scene, *find_variant("bdpt", variant));
        s.max_depth = 200;
        s.rr_depth = -1;
        const uint64_t planned = make_renderer(scene, s, accels)->stats().memory_bytes_predicted;
        const RenderResult any = render_counted(scene, s, 8, accels);
        REQUIRE(any.stats.memory_bytes > planned);  // waves grew
        s.memory = planned;
        const RenderResult divided = render_counted(scene, s, 8, accels);
        CHECK(divided.stats.memory_bytes_peak == planned);
        if (s.variant == "wavefront") CHECK(bool(divided.film.sum == any.film.sum));
    }
}
