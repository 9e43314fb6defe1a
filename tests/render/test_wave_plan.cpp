// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// Waves of a device for the memory that there is, planned on the host: the layouts are those of the device's kernels.
#include "render/wave_maker.h"

#include <map>

#include "accel/cwbvh.h"
#include "backends/fusion.h"
#include "core/error.h"
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

RenderSettings unordered(const Scene& scene, const char* integrator, const char* variant, uint32_t max_depth) {
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = integrator;
    s.variant = variant;
    s.max_depth = max_depth;
    s.queues.ordering = Ordering::none;
    return s;
}

template <template <Features, class, Fusion> class Of>
Planned plan_of(const char* integrator, const char* variant, double light_vertices, uint64_t samples, uint64_t room) {
    using Integrator = Of<kFeatures, CwbvhTracer, kDeviceFusion>;
    static const Scene scene = project_scene("cornell", 1920, 1080);
    RenderSettings s = unordered(scene, integrator, variant, 8);
    s.expected_samples = samples;
    s.memory = room;
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

namespace {

/// Of 5x3 whole tiles, unless another size is given.
Scene plain_film(uint32_t width = 40, uint32_t height = 24) {
    Scene scene;
    scene.sensor.crop_width = width;
    scene.sensor.crop_height = height;
    return scene;
}

WavePolicy light_policy(uint32_t iteration_samples) {
    WavePolicy waves;
    waves.light_subpaths_per_tile = kTilePixels;
    waves.keeps_light_vertices = true;
    waves.iteration_samples = iteration_samples;
    return waves;
}

template <class Function>
std::string refusal_of(ExitCode code, Function f) {
    try {
        f();
    } catch (const Error& error) {
        CHECK(error.code == code);
        return error.what();
    }
    return "no error";
}

}  // namespace

TEST_CASE("waves of a device hold all samples of an iteration, for as many tiles as there is room") {
    const Scene scene = plain_film();
    RenderSettings s;
    WavePolicy waves = light_policy(4);
    WavePlan plan(scene, s, waves, true, 0, true);
    for (const auto& [size, tiles] :
         std::vector<std::pair<uint32_t, uint32_t>>{{64, 1}, {1024, 4}, {1279, 4}, {1280, 5}, {1u << 20, 15}}) {
        CAPTURE(size);
        s.wave_size = size;
        plan.shape_least();
        CHECK(plan.wave.tiles == tiles);
        CHECK(plan.wave.samples == 4);
        CHECK(plan.film_wave.tiles == 15);
        CHECK(plan.film_wave.samples == 4);
        CHECK(plan.in_parts() == (tiles < 15));
        CHECK(plan.light_subpaths(0) == tiles * kTilePixels);
        CHECK(plan.light_subpaths_together() == 4 * 40 * 24);
        CHECK(waves.multi_bounce_below == tiles * kTilePixels * 4 / 16);
    }
    s.wave_size = 1024;
    plan.shape_least();
    CHECK(plan.light_subpaths(12) == 3 * kTilePixels);  // the last tiles
    plan.mean = 1;
    plan.keep(3072);
    CHECK(plan.mean == 3);
    plan.keep(2048);
    CHECK(plan.mean == 3);
    CHECK(plan.kept() == planned_light_vertices(3, 1024));
    waves.keeps_light_vertices = false;
    CHECK(plan.kept() == 0);
    // With room for it, the whole film.
    plan.shape_preferred(100, 1u << 30);
    CHECK(plan.wave.tiles == 15);
    CHECK_FALSE(plan.in_parts());
    s.wave_size = 0;
    s.expected_samples = 7;
    plan.shape_preferred(100, 1u << 30);
    CHECK(plan.wave.slot_count() == 15 * kTilePixels * 4);

    WavePolicy single = light_policy(1);
    WavePlan one(scene, s, single, true, 0, false);
    one.shape_preferred(100, 1u << 30);
    CHECK(one.wave.samples == 7);
    one.shape_preferred(100, 100 * kTilePixels);
    CHECK(one.wave.samples == 1);
    CHECK(one.wave.tiles == 15);
    // Of what is free a half, of a budget all.
    one.shape_preferred(100, 100 * 960 * 6);
    CHECK(one.wave.samples == 3);
    s.memory = 1u << 30;
    one.shape_preferred(100, 100 * 960 * 6);
    CHECK(one.wave.samples == 6);
}

TEST_CASE(
    "as many iterations are done at once as fill the machine, for which there is memory, and which were asked for") {
    const Scene scene = plain_film();  // 960 slots
    RenderSettings s;
    WavePolicy waves = light_policy(2);
    const auto all = [] { return true; };
    const auto choose = [&](uint32_t threads, uint32_t most, const std::function<bool()>& fits) {
        waves.iterations_together = most;
        WavePlan plan(scene, s, waves, true, threads, true);
        plan.choose_iterations(fits);
        CHECK(plan.light_subpaths_together() == uint64_t(waves.iterations_together) * 2 * 40 * 24);
        return waves.iterations_together;
    };
    CHECK(choose(0, 1, all) == 1);
    CHECK(choose(0, 64, all) == 64);
    CHECK(choose(0, 1u << 16, all) == kIterationsPlateau / 1920);
    CHECK(choose(1, 64, all) == 1);
    CHECK(choose(4, 64, all) == 4 * 4 * kHostWaveSize / 1920);
    CHECK(choose(0, 64, [&] { return waves.iterations_together <= 20; }) == 16);
    CHECK(choose(0, 64, [] { return false; }) == 1);
    s.expected_samples = 10;
    CHECK(choose(0, 64, all) == 5);
    s.expected_samples = 0;

    waves.iterations_together = 64;
    WavePlan plan(scene, s, waves, true, 0, true);
    plan.choose_iterations(all);
    plan.shape_preferred(100, 1u << 30);
    CHECK(plan.wave.samples == 128);
    CHECK(plan.film_wave.samples == 128);
    CHECK_FALSE(plan.in_parts());
    // With less room there are fewer, and then less of the film.
    CHECK(plan.fit(7 * 1920, [&] { return uint64_t(plan.wave.slot_count()); }));
    CHECK(plan.wave.samples == 14);
    CHECK_FALSE(plan.in_parts());
    CHECK(plan.fit(1000, [&] { return uint64_t(plan.wave.slot_count()); }));
    CHECK(plan.wave.samples == 2);
    CHECK(plan.wave.tiles == 7);
    s.wave_size = 5000;
    CHECK(choose(0, 64, all) == 2);
}

TEST_CASE("waves of a host are small, and those of light that lands anywhere hold one sample") {
    RenderSettings s;
    for (const auto& [threads, tiles, whole_tiles] :
         std::vector<std::array<uint32_t, 3>>{{1, 8, 136}, {2, 8, 136}, {3, 5, 140}, {17, 1, 136}, {64, 1, 136}}) {
        CAPTURE(threads);
        const Scene scene = plain_film(136, 64);  // 136 tiles
        const Wave wave = host_wave(scene, s, threads);
        CHECK(wave.tiles == tiles);
        CHECK(wave.samples == kHostWaveSize / (tiles * kTilePixels));
        for (const uint32_t k : {1, 4}) {
            WavePolicy waves = light_policy(k);
            WavePlan plan(scene, s, waves, true, threads, k > 1);
            plan.shape_preferred(500, 0);
            CHECK(plan.wave.tiles == tiles);
            CHECK(plan.wave.samples == 1);
            CHECK(plan.film_wave.tiles == whole_tiles);
            CHECK(plan.film_wave.samples == k);
            CHECK(plan.in_parts());
            CHECK(plan.light_subpaths(0) == tiles * kTilePixels);
        }
        WavePolicy narrow = light_policy(1);
        WavePlan plan(scene, s, narrow, false, threads, false);
        plan.shape_preferred(500, 0);
        CHECK(plan.wave.samples == wave.samples);
        CHECK_FALSE(plan.in_parts());
    }
    s.wave_size = 256;
    CHECK(host_wave(plain_film(136, 64), s, 1).tiles == 4);
    CHECK(host_wave(plain_film(136, 64), s, 1, 128).tiles == 2);
    // A film of a single wave is whole in it.
    const Scene small = plain_film(5, 3);
    WavePolicy waves = light_policy(1);
    WavePlan plan(small, s, waves, true, 1, false);
    plan.shape_preferred(500, 0);
    CHECK(plan.light_subpaths(0) == 15);
    waves.slots_in_flight = 1;
    plan.shape_preferred(500, 0);
    CHECK(waves.slots_in_flight == kTilePixels);
    s.wave_size = 4096;
    const Scene large = plain_film(512, 512);
    WavePlan streaming(large, s, waves, false, 1, false);
    streaming.shape_preferred(500, 0);
    CHECK(waves.slots_in_flight == 1024);
}

TEST_CASE("sizes of waves follow from what is expected, what there is room for and what pays") {
    const Scene scene = plain_film();  // 960 slots
    RenderSettings s;
    const auto size = [&](uint64_t room) { return device_wave_size(scene, s, 10000, 10, room); };
    CHECK(size(5000) == 500);
    CHECK(size(100) == kTilePixels);
    CHECK(size(1u << 30) == 10000);
    for (const auto& [samples, paths] :
         std::vector<std::pair<uint64_t, uint32_t>>{{3, 2880}, {10, 9600}, {11, 10000}}) {
        s.expected_samples = samples;
        CHECK(size(1u << 30) == paths);
    }
    CHECK(device_wave_size(plain_film(33, 17), s, 1u << 20, 10, 1u << 30) == 960 * 11);
    s.wave_size = 77;
    CHECK(size(5000) == 77);

    CHECK(stream_samples(100, 200, 0, 1000000) == 4);
    CHECK(stream_samples(100, 200, 3, 1000000) == 3);
    CHECK(stream_samples(100, 200, 5, 1000000) == 4);
    CHECK(stream_samples(100, 200, 0, 400) == 2);
    CHECK(stream_samples(100, 10000, 0, 1000000) == 1);
    for (const uint32_t batch : {1u, 3u, 4u}) CHECK(whole_waves(batch, 4) == 4);
    CHECK(whole_waves(5, 4) == 8);
    CHECK(learning_pass(8, 0, 4) == 1);
    CHECK(learning_pass(8, 3, 4) == 3);
    CHECK(learning_pass(2, 3, 4) == 2);
    CHECK(learning_pass(8, 4, 4) == 8);

    s = {};
    CHECK(multi_bounce_below(s, 1024) == 64);
    CHECK(multi_bounce_below(s, 1u << 20) == 1u << 15);
    for (const auto& [key, value] : std::vector<std::pair<std::string, std::string>>{{"tail", "false"},
                                                                                     {"deterministic", "true"},
                                                                                     {"technique_depth", "4"},
                                                                                     {"fuse", "none"},
                                                                                     {"compaction", "select"},
                                                                                     {"accel", "bvh2"},
                                                                                     {"accel", "optix"}}) {
        CAPTURE(key);
        RenderSettings other;
        apply_setting(other, key, value);
        CHECK(multi_bounce_below(other, 1024) == 0);
    }
}

TEST_CASE("where waves stand that go through the film tile by tile, and the largest of numbers that fit") {
    Wave wave = shape_wave(plain_film(), 1, 4 * kTilePixels, 15);  // 4 waves for a sample, the last of 3 tiles
    wave.samples = 2;
    const auto at = [&](uint32_t first_tile, uint32_t waves) {
        const WaveProgress p = progress_of(wave, first_tile, waves);
        return std::pair(p.samples, p.next_tile);
    };
    CHECK(at(0, 0) == std::pair(0u, 0u));
    CHECK(at(0, 3) == std::pair(0u, 12u));
    CHECK(at(0, 4) == std::pair(2u, 0u));
    CHECK(at(0, 5) == std::pair(2u, 4u));
    CHECK(at(8, 1) == std::pair(0u, 12u));
    CHECK(at(8, 2) == std::pair(2u, 0u));
    CHECK(at(8, 7) == std::pair(4u, 4u));
    const auto largest = [](uint32_t least, uint32_t most, uint32_t limit) {
        return largest_that_fits(least, most, [=](uint32_t n) {
            CHECK(n >= least);
            CHECK(n <= most);
            return n <= limit;
        });
    };
    for (uint32_t limit = 0; limit <= 12; ++limit)
        for (uint32_t least = 1; least <= 11; ++least) {
            CAPTURE(limit, least);
            const uint32_t expected = std::min(limit, 10u);
            CHECK(largest(least, 10, limit) == (least <= expected ? expected : 0));
        }
}

TEST_CASE("refusals name the bytes and the numbers that are in the way") {
    constexpr uint64_t kM = 1 << 20;
    RenderSettings s;
    s.memory = 64 * kM;
    RenderBytes least = {{kM, 2 * kM - 1, 4 * kM + 1}, 3 * kM, 6 * kM, 7 * kM};
    CHECK(least.total() == 23 * kM);
    const auto budget = [&] { return refusal_of(ExitCode::device, [&] { refuse_budget(s, least); }); };
    const std::string parts =
        "memory=64M: this render needs at least 23M: 1 of geometry, 2 of textures, 3 of acceleration structure, 5 of "
        "the rest of the scene, 6 of film, 7 of waves";
    CHECK(budget() == parts + ". Give it more memory, or a smaller --size, or, on a CUDA device, --textures host");
    s.textures = TextureMemory::host;
    CHECK(budget() == parts + ". Give it more memory, or a smaller --size");
    s.wave_size = 128;
    CHECK(budget() == parts + " of 128 paths. Give it more memory, or a smaller --size");
    CHECK(refusal_of(ExitCode::device, [] { refuse_wave(5 * kM, 3 * kM, 4096); }) ==
          "this render needs 5 MiB on the device, and 3 MiB are free: try a smaller --size or --set wave_size=N (now "
          "4096 paths)");
    CHECK(refusal_of(ExitCode::device, [] { refuse_film(plain_film()); }).find("a film of 40x24 needs more") !=
          std::string::npos);
    CHECK(refusal_of(ExitCode::usage, [] { refuse_samples({}, 4, 8, 3); }) ==
          "spp: integrator path, variant wavefront, has iterations of 4 samples; samples 8 to 11 are no whole ones");

    const Scene scene = plain_film(1920, 1080);
    s = {};
    WavePolicy waves = light_policy(1);
    WavePlan plan(scene, s, waves, true, 0, false);
    const auto fit = [&](uint32_t samples) {
        s.wave_size = samples * 1920 * 1080;
        plan.shape_least();
        return refusal_of(ExitCode::usage, [&] { plan.fit(1, [] { return uint64_t(1); }); });
    };
    CHECK(fit(2071) == "no error");
    waves.light_subpaths_per_tile = kTilePixels + 1;
    CHECK(fit(2071).find("wave_size=4294425600: more light subpaths than can be numbered") == 0);
}

TEST_CASE("light subpaths of a sample are as many as can be numbered, at most") {
    const auto refused = [](uint32_t width, uint32_t height, uint32_t per_tile) {
        RenderSettings s;
        s.integrator = "bdpt";
        s.light_subpaths_per_tile = per_tile;
        return refusal_of(ExitCode::usage, [&] { plan_bdpt(plain_film(width, height), s); });
    };
    CHECK(refused(65535, 65537, kTilePixels) == "no error");  // 2^32 - 1
    CHECK(refused(65536, 32768, kTilePixels) == "no error");
    CHECK(refused(65536, 32767, 2 * kTilePixels) == "no error");
    // A slot has as many rounds as it needs.
    CHECK(refused(65536, 32768, kTilePixels + kTilePixels / 2) ==
          "light_paths=1.5: a film of 65536x32768 has more light subpaths than can be numbered (4294967295)");
}

TEST_CASE("connections trace their rays themselves in small scenes, where nothing asks for their order") {
    struct {
        WavePolicy waves;
    } policy;
    policy.waves.queues.ordering = Ordering::none;
    CHECK(traces_connections(policy, 0));
    CHECK(traces_connections(policy, 4096));
    CHECK_FALSE(traces_connections(policy, 4097));
    const auto with = [&](const auto& change) {
        auto other = policy;
        change(other.waves);
        return traces_connections(other, 0);
    };
    CHECK_FALSE(with([](WavePolicy& w) { w.strategy_depth = 1; }));
    CHECK_FALSE(with([](WavePolicy& w) { w.deterministic = true; }));
    CHECK_FALSE(with([](WavePolicy& w) { w.queues.compaction = Compaction::select; }));
    CHECK_FALSE(with([](WavePolicy& w) { w.queues.ordering = Ordering::morton; }));
    CHECK(with([](WavePolicy& w) { w.cull = 1; }));
}

TEST_CASE("room for light vertices is a quarter more than their mean and six deviations, as far as can be numbered") {
    CHECK(planned_light_vertices(0, 1000) == 64);
    CHECK(planned_light_vertices(3, 10000) == 39642);  // 1.25 * 30000 + 6 * sqrt(120000) + 64
    CHECK(planned_light_vertices(0.5, 64) == 145);     // 1.25 * 32 + 6 * sqrt(48) + 64
    CHECK(planned_light_vertices(1e9, 1000) == 4'000'000'000u);
}

namespace {

/// Slots of the queues that have any.
using Rooms = std::map<std::string, uint32_t>;
constexpr uint32_t kSlots = 512, kStreams = 128, kKept = 700;  ///< of a wave; in flight; light vertices

template <template <Features, class, Fusion> class Of, Fusion K>
Rooms rooms_of(const char* integrator, const char* variant,
               const std::vector<std::pair<const char*, const char*>>& settings = {}) {
    using Integrator = Of<kFeatures, CwbvhTracer, K>;
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = integrator;
    s.variant = variant;
    s.max_depth = 5;
    for (const auto& [key, value] : settings) apply_setting(s, key, value);
    typename Integrator::Policy p = Integrator::plan(scene, s);
    p.waves.slots_in_flight = kStreams;
    Layout dry;
    Integrator::lay_out(dry, p, WaveSize{kSlots, kKept, {}});
    Rooms rooms;
    for (size_t q = 0; q < dry.queue_names().size(); ++q)
        if (const uint32_t capacity = dry.queue_capacities()[q]; capacity > 0) rooms[dry.queue_names()[q]] = capacity;
    return rooms;
}

/// `others`, and so many slots for each of `names`.
Rooms rooms(uint32_t slots, const std::vector<std::string>& names, Rooms others = {}) {
    for (const std::string& name : names) others[name] = slots;
    return others;
}

}  // namespace

TEST_CASE("queues have room for what their strategies can fill, and none where nothing fills them") {
    constexpr uint32_t kSplats = kKept + kSlots;  // at every vertex, and of the emitter itself
    const Rooms pairs = rooms(kSlots, {"eye_vertices", "pairs", "deferred"}, {{"light_vertices", kKept}}),
                hits = rooms(kSlots, {"hits", "rays"}),
                emission = rooms(kSlots, {"emission", "emission_contributions"}, hits),
                shadows = rooms(kSlots, {"vertices", "candidates", "shadows", "shadow_contributions"}, hits),
                splats =
                    rooms(kSlots, {"camera_vertices", "splat_candidates", "weighted_splats"}, {{"splats", kSplats}});
    const auto together = [](Rooms all, const std::vector<Rooms>& others) {
        for (const Rooms& other : others) all.insert(other.begin(), other.end());
        return all;
    };
    const auto staged = [](const char* key, const char* value) {
        return rooms_of<WavefrontIntegrator, kNoFusion>("bdpt", "wavefront", {{key, value}});
    };
    CHECK(staged("strategies", "all") == together(emission, {shadows, pairs, splats}));
    CHECK(staged("max_depth", "2") == together(emission, {shadows, splats}));
    CHECK(staged("strategies", "hits") == emission);
    CHECK(staged("strategies", "next_event") == shadows);
    CHECK(staged("strategies", "connections") == together(shadows, {pairs}));
    CHECK(staged("strategies", "light") == together(hits, {splats}));
    CHECK(rooms_of<LightIntegrator, kNoFusion>("light", "wavefront", {{"light_paths", "2"}}) ==
          together(rooms(kKept + 2 * kSlots, {"splats"}, hits), {splats}));
    const Rooms fused = rooms(kSlots, {"shadows", "weighted_splats"}, {{"splats", kSplats}});
    CHECK(rooms_of<WavefrontIntegrator, kDeviceFusion>("bdpt", "wavefront") == together(hits, {fused, pairs}));
    CHECK(rooms_of<WavefrontIntegrator, kHostFusion>("bdpt", "wavefront") ==
          together(hits, {fused, {{"light_vertices", kKept}}}));
    CHECK(rooms_of<WavefrontIntegrator, kHostFusion>("bdpt", "wavefront", {{"strategies", "hits"}}) == hits);

    CHECK(rooms_of<PathTracer, kNoFusion>("path", "wavefront") == together(emission, {shadows}));
    CHECK(rooms_of<PathTracer, kNoFusion>("path", "wavefront", {{"estimator", "naive"}}) == emission);
    CHECK(rooms_of<PathTracer, kDeviceFusion>("path", "wavefront") == rooms(kSlots, {"shadows"}, hits));
    CHECK(rooms_of<PathTracer, kDeviceFusion>("path", "wavefront", {{"estimator", "naive"}}) == hits);

    const std::vector<std::pair<const char*, const char*>> only_hits = {{"strategies", "hits"}};
    CHECK(rooms_of<MegakernelIntegrator, kNoFusion>("bdpt", "megakernel") ==
          Rooms{{"light_vertices", kKept}, {"splats", kSplats}});
    CHECK(rooms_of<MegakernelIntegrator, kNoFusion>("bdpt", "megakernel", only_hits).empty());

    const std::vector<std::string> light = {"light_hits", "pairs",           "vertices",
                                            "shadows",    "camera_vertices", "weighted_splats"},
                                   staged_light = {"candidates", "shadow_contributions", "splat_candidates"};
    const Rooms streams = rooms(kStreams, {"rays", "eye_hits", "turns"}),
                streamed = rooms(kStreams, light, rooms(with_holes(kStreams), {"splats"}, streams)),
                seen = rooms(kStreams, {"emission", "emission_contributions"}, streams);
    CHECK(rooms_of<StreamingIntegrator, kDeviceFusion>("bdpt", "streaming") == streamed);
    CHECK(rooms_of<StreamingIntegrator, kNoFusion>("bdpt", "streaming") ==
          together(rooms(kStreams, staged_light, streamed), {seen}));
    CHECK(rooms_of<StreamingIntegrator, kDeviceFusion>("bdpt", "streaming", only_hits) == streams);
    CHECK(rooms_of<StreamingIntegrator, kNoFusion>("bdpt", "streaming", only_hits) == seen);
}

TEST_CASE(
    "what paths are by strategy has room where images of strategies are asked for, a lane a path, and else none") {
    const auto bytes = [](uint32_t strategy_depth, uint32_t paths) {
        WavePolicy waves;
        waves.strategy_depth = strategy_depth;
        Layout dry;
        EyeQueues<UnidirectionalMis>::lay_out<kHostFusion, kFeatures>(dry, kSlots, paths, {}, waves);
        return dry.bytes();
    };
    CHECK(bytes(0, kSlots) == bytes(0, 0));
    CHECK(bytes(1, kSlots) == bytes(0, 0) + kSlots * sizeof(Lane));
    CHECK(bytes(3, 2 * kSlots) == bytes(0, 0) + 2 * kSlots * sizeof(Lane));
}

namespace {

template <template <Features, class, Fusion> class Of, Features F>
auto stages_of(const char* integrator, const char* variant, float cull) {
    using Integrator = Of<F, CwbvhTracer, kDeviceFusion>;
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings s = unordered(scene, integrator, variant, 5);
    s.cull = cull;
    WaveMaker<Integrator, F, CwbvhTracer> maker = {
        scene, s, 0, {{}, [](QueuePolicy, uint32_t) { return uint64_t(0); }}};
    maker.plan.shape_least();
    WaveMemory<Integrator> memory;
    Layout dry;
    return maker.lay_out(dry, memory, 0);
}

template <Features F>
void check_seeds(float cull) {
    CAPTURE(F.opacity, cull);
    const bool seeds = F.opacity || cull > 0;
    CHECK(stages_of<PathTracer, F>("path", "wavefront", cull).connect_emitter.connect.seeds == seeds);
    const auto lvc = stages_of<LvcIntegrator, F>("bdpt", "lvc", cull);
    CHECK(lvc.connect_emitter.connect.next_event.seeds == seeds);
    CHECK(lvc.connect_vertices.seeds == seeds);
    CHECK(lvc.connect_deferred.seeds == seeds);
    const auto streaming = stages_of<StreamingIntegrator, F>("bdpt", "streaming", cull);
    CHECK(streaming.connect_emitter.connect.seeds == seeds);
    CHECK(streaming.connect_vertices.seeds == seeds);
}

}  // namespace

TEST_CASE("shadow rays have seeds where surfaces let some rays pass or some are left out, however few") {
    for (const float cull : {0.0f, 0.005f, 1.0f}) {
        check_seeds<kDiffuseFeatures>(cull);
        check_seeds<kFeatures>(cull);
    }
}

TEST_CASE("strategies that a render does without are named") {
    const Scene scene = project_scene("cornell", 16, 16);
    const auto skipped = [](const Scene& of, const char* strategies, int max_depth) {
        RenderSettings s = cpu_settings(of, Estimator::mis);
        s.integrator = "bdpt";
        s.max_depth = max_depth;
        apply_setting(s, "strategies", strategies);
        return skipped_strategies(of, plan_bdpt(of, s));
    };
    using Names = std::vector<std::string>;
    const std::string subpaths = "light subpaths: no strategy needs them", light = "light tracing (t = 1)",
                      connections = "connections (s, t >= 2)", next_event = "next event estimation (s = 1)",
                      hits = "hits of area emitters (s = 0)";
    CHECK(skipped(scene, "all", 3).empty());
    CHECK(skipped(scene, "all", 2) == Names{connections});
    CHECK(skipped(scene, "all", 1) == Names{connections, next_event});
    CHECK(skipped(scene, "all", 0) == Names{subpaths, light, connections, next_event});
    CHECK(skipped(scene, "hits", 5) == Names{subpaths, light, connections, next_event});
    CHECK(skipped(scene, "next_event", 5) == Names{subpaths, light, connections, hits});
    CHECK(skipped(scene, "connections", 5) == Names{light, next_event, hits});
    CHECK(skipped(scene, "light", 5) ==
          Names{connections, next_event, hits, "eye subpaths beyond their first segment"});
    CHECK(skipped(plain_film(), "all", 5) ==
          Names{"all strategies: no emitters", subpaths, light, connections, next_event, hits});
}
