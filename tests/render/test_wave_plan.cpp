// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Waves of a device for the memory that there is, planned on the host: the layouts are those of the device's kernels.
#include "render/wave_maker.h"

#include "accel/cwbvh.h"
#include "backends/fusion.h"
#include "integrators/bdpt/lvc/integrator.h"
#include "integrators/bdpt/megakernel/integrator.h"
#include "integrators/bdpt/streaming/integrator.h"
#include "integrators/bdpt/wavefront/integrator.h"
#include "integrators/feature_levels.h"
#include "integrators/path/integrator.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

constexpr Features kFeatures = kAllFeatures;  // whose items are the largest

template <Features F, class Tracer, Fusion K>
using PathTracer = PathIntegrator<F, Tracer, K>;

/// The wave of a render of `samples` at 1920x1080 and depth 8 in `room` bytes.
struct Planned {
    uint64_t bytes = 0;  ///< film and queues
    uint32_t paths = 0;  ///< of a wave; of streaming, slots
    bool in_parts = false, fits = false;
};

template <template <Features, class, Fusion> class Of>
Planned plan_of(const char* integrator, const char* variant, double light_vertices, uint64_t samples, uint64_t room) {
    using Integrator = Of<kFeatures, CwbvhTracer, kDeviceFusion>;
    static const Scene scene = project_scene("cornell", 1920, 1080);
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = integrator;
    s.variant = variant;
    s.max_depth = 8;
    s.expected_samples = samples;
    s.queues.ordering = Ordering::none;
    WaveMaker<Integrator, kFeatures, CwbvhTracer> maker = {
        scene, s, 0, {{}, [](QueuePolicy, uint32_t) { return uint64_t(0); }}};
    WavePlan& plan = maker.plan;
    plan.mean = light_vertices;
    const auto needed = [&] { return maker.film_bytes() + maker.wave_bytes(plan.kept()); };
    plan.shape_preferred(500, room);
    Planned p;
    p.fits = plan.fit(room, needed);
    p.bytes = needed();
    p.paths = plan.streams() ? maker.policy.waves.slots_in_flight : plan.wave.slot_count();
    p.in_parts = plan.in_parts();
    return p;
}

constexpr uint64_t kMiB = 1 << 20;

}  // namespace

TEST_CASE("waves of a device that hold a part of the film go through all of it once, from wherever they failed") {
    const Scene scene = project_scene("cornell", 1920, 1080);
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.expected_samples = 1;
    WavePolicy waves;
    waves.light_subpaths_per_tile = kTilePixels;
    waves.keeps_light_vertices = true;
    WavePlan plan(scene, s, waves, true, 0, false);
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

TEST_CASE("one sample of 1920x1080, with any method, in 256 MiB, 1 GiB and 4 GiB of a device") {
    for (const double light_vertices : {1.0, 4.0, 8.0})  // of a light subpath of up to 8 segments
        for (const uint64_t room : {256 * kMiB, 1024 * kMiB, 4096 * kMiB}) {
            CAPTURE(light_vertices, room / kMiB);
            const Planned path = plan_of<PathTracer>("path", "wavefront", 0, 1, room),
                          light = plan_of<LightIntegrator>("light", "wavefront", light_vertices, 1, room),
                          wavefront = plan_of<WavefrontIntegrator>("bdpt", "wavefront", light_vertices, 1, room),
                          lvc = plan_of<LvcIntegrator>("bdpt", "lvc", light_vertices, 1, room),
                          streaming = plan_of<StreamingIntegrator>("bdpt", "streaming", light_vertices, 1, room),
                          megakernel = plan_of<MegakernelIntegrator>("bdpt", "megakernel", light_vertices, 1, room);
            for (const Planned& p : {path, light, wavefront, lvc, streaming, megakernel}) {
                CHECK(p.fits);
                CHECK(p.bytes <= room);
            }
            CHECK_FALSE(streaming.in_parts);
            CHECK(lvc.in_parts == (room < 4096 * kMiB));
            CHECK_FALSE(path.in_parts);
            if (light_vertices >= 4 && !lvc.in_parts) CHECK(streaming.bytes < lvc.bytes);
        }
}
