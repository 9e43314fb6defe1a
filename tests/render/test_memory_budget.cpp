// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// The setting memory: what a render allocates stays below it, whatever it renders, and its image is the same.
#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "accel/shared_accels.h"
#include "core/error.h"
#include "integrators/parse_value.h"
#include "integrators/registry.h"
#include "render/device_plan.h"
#include "tests/support/bidirectional_images.h"

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

/// The least that this render needs: with waves of one tile. Of one acceleration structure, lest its size differ.
uint64_t least_bytes(const Scene& scene, RenderSettings s, SharedAccels& accels) {
    s.memory = 0;
    s.wave_size = kTilePixels;
    return make_renderer(scene, s, accels)->stats().memory_bytes_predicted;
}

/// What a renderer takes while it is made and while it renders `spp`, in its own count and by operator new.
RenderResult render_counted(const Scene& scene, const RenderSettings& s, uint32_t spp, SharedAccels& accels) {
    // Names, records, tasks of the scheduler, the pilot's vectors: what is not counted.
    constexpr int64_t kSmall = 1 << 20;
    const int64_t before = held;
    most = before;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s, accels);
    REQUIRE(renderer->render(0, spp) == spp);
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
}

TEST_CASE("1920x1080 within 256 MiB, 1 GiB and 4 GiB, of all integrators and variants on the CPU") {
    const Scene scene = project_scene("cornell", 1920, 1080);
    SharedAccels accels(scene);
    for (const Variant& variant : variants())
        for (const char* memory : {"256M", "1G", "4G"}) {
            CAPTURE(variant.name(), memory);
            RenderSettings s = settings_of(scene, variant);
            apply_setting(s, "memory", memory);
            render_counted(scene, s, 0, accels);  // all is there before the first sample
        }
}

TEST_CASE("the least budget renders, one byte less is refused with the bytes of each part") {
    const Scene scene = project_scene("materials", 96, 64);
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
        CHECK(least.stats.memory_bytes < any.stats.memory_bytes);
        CHECK(bool(least.film.sum == any.film.sum));
        CHECK(bool(least.film.sum_squares == any.film.sum_squares));
    }
}

TEST_CASE("a budget does not change the expectation of bidirectional variants") {
    const Scene scene = project_scene("materials", 48, 32);
    SharedAccels accels(scene);
    RenderSettings reference = settings_of(scene, *find_variant("bdpt", "wavefront"));
    reference.seed = 5;
    const Estimate expected = render_batches(scene, reference, 512);
    for (const char* variant : {"wavefront", "lvc"}) {
        RenderSettings s = settings_of(scene, *find_variant("bdpt", variant));
        s.memory = least_bytes(scene, s, accels);
        const ZTestResult result = z_test(render_batches(scene, s, 512), expected);
        INFO(variant << "\n" << result.report());
        CHECK(result.pass);
    }
}

TEST_CASE("more light vertices than were planned for: waves are divided where the budget has no room for them") {
    // Few light subpaths of very different lengths, whose number of vertices scatters widely around the pilot's mean.
    const Scene scene = project_scene("furnace", 64, 64);
    SharedAccels accels(scene);
    RenderSettings s = settings_of(scene, *find_variant("bdpt", "lvc"));
    s.max_depth = 400;
    s.rr_cap = 1.0f;
    s.rr_depth = -1;
    const uint64_t least = least_bytes(scene, s, accels);
    for (const uint64_t more : {uint64_t(0), uint64_t(64) << 10, uint64_t(1) << 20}) {
        CAPTURE(more);
        s.memory = least + more;
        try {
            render_counted(scene, s, 2, accels);
        } catch (const Error& e) {
            // A single tile may need more than there is: said, not exceeded.
            CHECK(e.code == ExitCode::device);
            CHECK(std::string(e.what()).find("at least") != std::string::npos);
        }
    }
}

TEST_CASE("waves of a device that hold a part of the film go through all of it once, from wherever they failed") {
    const Scene scene = project_scene("cornell", 1920, 1080);
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.expected_samples = 1;
    WavePolicy waves;
    waves.light_subpaths_per_tile = kTilePixels;
    waves.keeps_light_vertices = true;
    DevicePlan plan(scene, s, waves, true);
    plan.mean = 3.0;
    constexpr uint64_t kFilm = 200 << 20, kPath = 500, kVertex = 96;
    const auto needed = [&] { return kFilm + kPath * plan.wave.slot_count() + kVertex * plan.kept(); };
    plan.shape_preferred(kPath, uint64_t(1) << 40);
    CHECK_FALSE(plan.in_parts());
    CHECK(plan.wave.samples == 1);
    const uint32_t all = tile_count(plan.wave);
    uint32_t tiles = all;
    for (const uint64_t room : {uint64_t(4096) << 20, uint64_t(1024) << 20, uint64_t(256) << 20, uint64_t(201) << 20}) {
        CAPTURE(room);
        REQUIRE(plan.fit(room, needed));
        CHECK(needed() <= room);
        CHECK(plan.film_wave.tiles == all);
        CHECK(plan.wave.tiles <= tiles);
        tiles = plan.wave.tiles;
        // One tile more would be too much.
        if (plan.in_parts()) CHECK(needed() + 2 * kTilePixels * (kPath + kVertex * 4) > room);
        uint64_t subpaths = 0;
        for (uint32_t tile = 0; tile < all; tile += tiles) subpaths += plan.light_subpaths(tile);
        CHECK(subpaths == 1920 * 1080);
    }
    CHECK(plan.in_parts());
    const uint32_t per_sample = (all + tiles - 1) / tiles;
    for (const uint32_t failed_after : {0u, 1u, per_sample - 1, per_sample, per_sample + 1, 3 * per_sample}) {
        CAPTURE(failed_after);
        const WaveProgress first = progress_of(plan.wave, 0, failed_after);
        CHECK(first.samples == failed_after / per_sample);
        CHECK(first.next_tile == failed_after % per_sample * tiles);
        const WaveProgress rest = progress_of(plan.wave, first.next_tile, 4 * per_sample - failed_after);
        CHECK(first.samples + rest.samples == 4);
        CHECK(rest.next_tile == 0);
    }
    CHECK_FALSE(plan.fit(kFilm, needed));
    CHECK(plan.wave.tiles == 1);
    s.wave_size = 1 << 22;  // more than the film has pixels: not made smaller
    plan.shape_preferred(kPath, uint64_t(1) << 40);
    CHECK_FALSE(plan.fit(uint64_t(1) << 30, needed));
    CHECK(plan.wave.samples == 2);
    s.wave_size = 1 << 16;  // less: the film is added to it where there is room, and else not
    plan.shape_preferred(kPath, uint64_t(1) << 40);
    CHECK_FALSE(plan.in_parts());
    REQUIRE(plan.fit(uint64_t(512) << 20, needed));
    CHECK(plan.in_parts());
    CHECK(plan.wave.slot_count() >= s.wave_size);
}
