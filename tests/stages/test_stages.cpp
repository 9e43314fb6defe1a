// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 120
// The stages of the path tracer, run by hand over host queues: what is no light is counted where it appears (G9), ids
// hold what they must (G4), queues count what they lose (G3).
#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "accel/cwbvh.h"
#include "core/error.h"
#include "integrators/path/integrator.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

/// Every stage by itself, with queues between them.
using Integrator = PathIntegrator<kAllFeatures, CwbvhTracer, Fusion{}>;
using Stages = Integrator::Stages;

/// A wave over the whole film of a scene, stopped between stages.
struct Bench {
    Scene scene;
    CwbvhAccel accel;
    Integrator::Policy policy;
    Wave wave;
    WaveState state{};
    std::vector<std::byte> bytes;
    std::vector<Lane> samples;
    std::vector<double> sum, sum_squares;
    Layout layout;
    Integrator::Memory memory;
    int place = 0;  ///< of the subpaths of this depth

    explicit Bench(Scene s, uint32_t samples_per_pixel = 1) : scene(std::move(s)), accel(scene) {
        const RenderSettings settings = cpu_settings(scene, Estimator::mis);
        policy = Integrator::plan(scene, settings);
        const uint32_t film_tiles = tile_count(shape_wave(scene, settings.seed, kTilePixels, 1));
        wave = shape_wave(scene, settings.seed, film_tiles * kTilePixels * samples_per_pixel, film_tiles);
        const uint32_t slots = wave.slot_count();
        samples.resize(slots);
        sum.resize(size_t(wave.width) * wave.height * 3);
        sum_squares.resize(sum.size());
        memory = Integrator::lay_out(layout, policy, {slots, 0});
        stages(), update();
        const Layout plan = layout;
        bytes.resize(plan.bytes() + 256);
        void* start = bytes.data();
        size_t room = bytes.size();
        layout = Layout(plan, std::align(256, plan.bytes(), start, room));
        memory = Integrator::lay_out(layout, policy, {slots, 0});
        stages(), update();
        REQUIRE(layout.bytes() == plan.bytes());
        REQUIRE(layout.record_names() == plan.record_names());
        const std::vector<QueueCounter> counters = layout.first_counters();
        std::copy(counters.begin(), counters.end(), layout.counters());
        state = {0, 0, samples_per_pixel, 1, 0, 0, 0};
    }
    Wave this_wave() const {
        Wave w = wave;
        w.state = &state;
        return w;
    }
    FilmSums sums() { return {sum.data(), sum_squares.data()}; }
    Stages stages() {
        const SceneView view = scene.view();
        const CwbvhTracer tracer = accel.tracer();
        const Wave in_flight = this_wave();
        const FilmBuffers film = {samples.data(), {}, sums()};
        return Stages(WaveParts<CwbvhTracer>{layout, view, tracer, in_flight, film}, policy, memory, NoState());
    }
    UpdateFilm update() { return {this_wave(), samples.data(), {}, sums(), layout.record(UpdateFilm::kName)}; }
    const StageRecord& record(const std::string& name) const {
        const std::vector<std::string>& names = layout.record_names();
        const auto at = std::find(names.begin(), names.end(), name);
        REQUIRE(at != names.end());
        return layout.records()[at - names.begin()];
    }

    template <class Stage>
    void run(const Stage& stage) {
        const auto& queue = stage.items();
        const uint32_t n = queue.counter->size();
        for (uint32_t i = 0; i < n; ++i) stage(i);
        queue.counter->finish();
    }
    void generate() {
        const Stages s = stages();
        for (uint32_t i = 0; i < wave.slot_count(); ++i) s.generate(i);
    }
    /// From a wave of rays to the film.
    void finish() {
        while (memory.subpaths.rays[0].counter->count > 0) {
            extend();
            finish_depth();
        }
        update_film();
    }
    void extend() {
        const SubpathQueues<PathRay>& q = memory.subpaths;
        q.hits[place].counter->count = q.rays[place].counter->size();
        run(stages().extend[place]);
    }
    void shade() {
        run(stages().eye_vertex[place]);
        place = 1 - place;
    }
    /// From hits to the samples.
    void finish_depth() {
        shade();
        finish_contributions();
    }
    void finish_contributions() {
        const Stages s = stages();
        run(s.eye.weigh_emission);
        run(s.eye.accumulate_emission);
        run(s.connect_emitter);
        run(s.eye.weigh);
        run(s.eye.occlude);
        run(s.eye.accumulate);
    }
    void update_film() {
        const UpdateFilm stage = update();
        for (uint32_t i = 0; i < wave.tiles * kTilePixels; ++i) stage(i);
    }
    /// Only stage `stage` counted anything, and what it counted is this; the film is finite, and light all the same.
    void check_counts(const std::string& stage, uint64_t nan, uint64_t inf, uint64_t negative) const {
        record(stage);
        for (const std::string& name : layout.record_names()) {
            INFO("counts of " << name << ", injected into " << stage);
            CHECK(record(name).nan == (name == stage ? nan : 0));
            CHECK(record(name).inf == (name == stage ? inf : 0));
            CHECK(record(name).negative == (name == stage ? negative : 0));
        }
        double total = 0;
        for (double v : sum) {
            CHECK(std::isfinite(v));
            CHECK(v >= 0);
            total += v;
        }
        CHECK(total > 0);
    }
};

Bench cornell() { return Bench(project_scene("cornell", 16, 16)); }

template <class Item>
void change(const Queue<Item>& queue, uint32_t i, const std::function<void(Item&)>& f) {
    REQUIRE(i < queue.counter->size());
    Item item = queue.load(i);
    f(item);
    queue.store(i, item);
}

}  // namespace

TEST_CASE("the active slots before a slot are counted without a look at them", "[stages]") {
    const Scene scene = project_scene("cornell", 37, 21);  // the last tiles of rows and columns are cut
    const RenderSettings settings = cpu_settings(scene, Estimator::mis);
    for (const uint32_t tiles : {15u, 5u, 4u, 1u}) {
        Wave wave = shape_wave(scene, settings.seed, tiles * kTilePixels * 3, tiles);
        REQUIRE(wave.tiles == tiles);
        for (uint32_t first = 0; first < 15; first += tiles) {
            const WaveState state = {first, 7, 2, 0, 0, 0, 0};  // fewer samples than there is room for
            wave.state = &state;
            uint32_t before = 0;
            const uint32_t slots = tiles * kTilePixels * state.samples;
            for (uint32_t slot = 0; slot < slots; ++slot) {
                if (!wave.locate(slot).active) continue;
                REQUIRE(wave.active_before(slot) == before);
                ++before;
            }
            CHECK(wave.active_before(slots) == before);
        }
    }
}

TEST_CASE("G9: nothing is counted in a clean wave", "[stages]") {
    Bench b = cornell();
    b.generate();
    b.finish();
    b.check_counts("generate", 0, 0, 0);
}

TEST_CASE("G9: a sensor without a place is counted by extend, ray by ray", "[stages]") {
    Bench b = cornell();
    b.scene.sensor.to_world.m[0][3] = kNan;
    b.generate();
    b.finish();
    CHECK(b.record("generate").nan == 0);
    CHECK(b.record("extend").nan == 256);
    for (double v : b.sum) CHECK(v == 0);
}

TEST_CASE("G9: extend counts rays that are not finite", "[stages]") {
    Bench b = cornell();
    b.generate();
    change<PathRay>(b.memory.subpaths.rays[0], 3, [](PathRay& r) { r.direction.y = kNan; });
    change<PathRay>(b.memory.subpaths.rays[0], 5, [](PathRay& r) { r.origin.x = kInf; });
    b.finish();
    b.check_counts("extend", 2, 0, 0);
}

TEST_CASE("G9: shade counts emission and throughput that are no light", "[stages]") {
    for (auto [value, which] : {std::pair{kNan, 0}, {kInf, 1}, {-1.0f, 2}}) {
        Bench b = cornell();
        b.generate();
        b.extend();
        uint32_t wall = kNone;
        for (uint32_t i = 0; i < b.memory.subpaths.hits[0].counter->size(); ++i) {
            const uint32_t prim = b.memory.subpaths.hits[0].load(i).prim;
            if (prim != kNone && b.scene.shapes[b.scene.view().shape_of(prim)].emitter == kNone) wall = i;
        }
        REQUIRE(wall != kNone);
        change<PathHit>(b.memory.subpaths.hits[0], wall, [v = value](PathHit& h) { h.ray.throughput = {1, v, 1}; });
        b.shade();
        const StageRecord& r = b.record("shade");
        CHECK(r.nan == (which == 0 ? 1 : 0));
        CHECK(r.inf == (which == 1 ? 1 : 0));
        CHECK(r.negative == (which == 2 ? 1 : 0));
    }
    Scene scene = scene_from_text(
        "<scene version='3.0.0'><sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,1' "
        "target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='4'/>"
        "<integer name='height' value='4'/><rfilter type='box'/></film></sensor><shape type='rectangle'><emitter "
        "type='area'/></shape></scene>");
    for (auto [value, which] : {std::pair{kNan, 0}, {kInf, 1}, {-1.0f, 2}}) {
        Bench b(scene);
        b.scene.emitters[0].radiance.value.y = value;
        b.generate();
        b.finish();
        const StageRecord& r = b.record("shade");
        CHECK(r.nan == (which == 0 ? 16 : 0));
        CHECK(r.inf == (which == 1 ? 16 : 0));
        CHECK(r.negative == (which == 2 ? 16 : 0));
        for (double v : b.sum) CHECK(v == 0);
    }
}

TEST_CASE("G9: connect counts light that is none", "[stages]") {
    for (auto [value, which] : {std::pair{kNan, 0}, {kInf, 1}, {-1.0f, 2}}) {
        Bench b = cornell();
        b.generate();
        b.extend();
        b.shade();
        const uint32_t n = b.memory.eye.vertices.counter->size();
        REQUIRE(n > 100);
        for (uint32_t i = 0; i < n; i += 2)
            change<VertexItem<UnidirectionalMis>>(b.memory.eye.vertices, i,
                                                  [v = value](auto& x) { x.throughput.z = v; });
        b.finish_contributions();
        b.update_film();
        const StageRecord& r = b.record("connect");
        const uint64_t counted = which == 0 ? r.nan : which == 1 ? r.inf : r.negative;
        CHECK(counted > n / 4);  // those that see the front of the lamp
        CHECK(counted <= (n + 1) / 2);
        b.check_counts("connect", which == 0 ? counted : 0, which == 1 ? counted : 0, which == 2 ? counted : 0);
    }
}

TEST_CASE("G9: mis_weight counts densities and light that are none", "[stages]") {
    Bench b = cornell();
    b.generate();
    b.extend();
    b.shade();
    b.run(b.stages().connect_emitter);
    change<CandidateItem>(b.memory.eye.candidates, 0, [](CandidateItem& c) { c.ratio = kNan; });
    change<CandidateItem>(b.memory.eye.candidates, 1, [](CandidateItem& c) { c.value.x = kInf; });
    change<CandidateItem>(b.memory.eye.candidates, 2, [](CandidateItem& c) { c.value.x = -1; });
    b.finish_contributions();
    b.update_film();
    b.check_counts("mis_weight", 1, 1, 1);
}

TEST_CASE("G9: occlude counts shadow rays that are not finite", "[stages]") {
    Bench b = cornell();
    b.generate();
    b.extend();
    b.shade();
    b.run(b.stages().connect_emitter);
    b.run(b.stages().eye.weigh);
    change<ShadowItem>(b.memory.eye.shadows, 0, [](ShadowItem& s) { s.direction.x = kNan; });
    change<ShadowItem>(b.memory.eye.shadows, 1, [](ShadowItem& s) { s.origin.z = kInf; });
    b.finish_contributions();
    b.update_film();
    b.check_counts("occlude", 2, 0, 0);
}

TEST_CASE("G9: accumulate and update_film count what reaches them", "[stages]") {
    Bench b = cornell();
    b.generate();
    b.memory.eye.emission_contributions.push({{kNan, 0, 0}, 0});
    b.memory.eye.emission_contributions.push({{0, kInf, 0}, 1});
    b.memory.eye.emission_contributions.push({{0, 0, -1}, 2});
    b.memory.eye.emission_contributions.push({{kInf, kNan, 0}, 3});
    b.finish_contributions();
    b.finish();
    b.check_counts("accumulate", 2, 1, 1);

    Bench d = cornell();
    d.generate();
    const float bad[3] = {kNan, kInf, -1};
    for (uint32_t i = 0; i < 3; ++i) {
        const Rgb value = {bad[i], 0, 0};
        std::memcpy(&d.samples[i], &value, sizeof(value));
    }
    d.memory.eye.emission_contributions.push({{1, 1, 1}, 10});
    d.finish_contributions();
    d.update_film();
    d.check_counts("update_film", 1, 1, 1);
}

TEST_CASE("G4: subpath bits hold every depth, flag and index", "[stages]") {
    for (uint32_t depth : {0u, 1u, 20u, 255u, 256u, 16382u, 16383u})
        for (bool delta : {false, true})
            for (float eta : {0.0f, 0.25f, 1.0f, 1.5f, 7.3e4f, 1e-30f}) {
                const SubpathBits b = SubpathBits::make(depth, delta, eta);
                CHECK(b.depth() == depth);
                CHECK(b.delta() == delta);
                CHECK(std::abs(b.roulette_scale() - eta) <= eta * 0.0079f);  // 7 bits of mantissa
            }
    CHECK(kMaxDepth == 16383);
}

TEST_CASE("Quotients by multiplication are exact", "[stages]") {
    const auto same = [](uint32_t n, uint32_t d) { return Divisor(d).quotient(n) == n / d; };
    bool exact = true;
    std::mt19937 random(1);
    for (uint32_t d = 1; d < 3000; ++d)
        for (uint32_t n : {0u, 1u, d - 1, d, d + 1, 0x7fffffffu, 0x80000000u, 0xffffffffu / d * d - 1,
                           0xffffffffu / d * d, 0xfffffffeu, 0xffffffffu})
            exact = exact && same(n, d);
    for (int i = 0; i < 1000000; ++i) {
        const uint32_t d = std::max(1u, uint32_t(random()) >> (random() & 31u)), n = uint32_t(random());
        exact = exact && same(n, d) && same(n / d * d, d) && same(n / d * d - 1, d);
    }
    for (uint32_t d : {0x7fffffffu, 0x80000000u, 0x80000001u, 0xffffffffu})
        for (uint32_t n : {0u, d - 1, d, d + 1, 0xffffffffu}) exact = exact && same(n, d);
    CHECK(exact);
}

TEST_CASE("G4: slots and pixels are one to one", "[stages]") {
    for (auto [w, h] : {std::pair{1u, 1u}, {7u, 9u}, {8u, 8u}, {17u, 3u}, {64u, 33u}})
        for (uint32_t tiles : {1u, 3u, 1000u})
            for (uint32_t samples : {1u, 3u}) {
                Wave wave{};
                wave.width = w;
                wave.height = h;
                wave.tiles_x = (w + kTileSide - 1) / kTileSide;
                wave.tiles = std::min(tiles, tile_count(wave));
                wave.samples = samples;
                std::set<std::tuple<uint32_t, uint32_t, uint32_t>> seen;
                const uint32_t total = 5;
                for (uint32_t tile = 0; tile < tile_count(wave); tile += wave.tiles)
                    for (uint32_t s = 0; s < total; s += samples) {
                        WaveState state{};
                        state.first_tile = tile;
                        state.first_sample = 40 + s;
                        state.samples = std::min(samples, total - s);
                        wave.state = &state;
                        for (uint32_t slot = 0; slot < wave.slot_count(); ++slot) {
                            const PathSlot p = wave.locate(slot);
                            if (!p.active) continue;
                            CHECK(p.pixel == p.y * w + p.x);
                            CHECK(p.sample - 40 < total);
                            CHECK(seen.insert({p.x, p.y, p.sample}).second);
                        }
                    }
                CHECK(seen.size() == size_t(w) * h * total);
            }
    // A film whose sides are no powers of two and past 12 bits.
    Wave wave{};
    wave.width = wave.height = 4097;
    wave.tiles_x = (4097 + kTileSide - 1) / kTileSide;
    wave.tiles = tile_count(wave);
    wave.samples = 1;
    WaveState state{};
    state.samples = 1;
    wave.state = &state;
    REQUIRE(wave.slot_count() == 513u * 513u * 64u);
    std::vector<bool> seen(4097u * 4097u);
    uint64_t active = 0;
    for (uint32_t slot = 0; slot < wave.slot_count(); ++slot) {
        const PathSlot p = wave.locate(slot);
        if (!p.active) continue;
        ++active;
        seen[p.pixel] = true;
    }
    CHECK(active == 4097u * 4097u);
    CHECK(std::find(seen.begin(), seen.end(), false) == seen.end());
}

TEST_CASE("G4: a film of 4097 x 4097 at depth 20 renders, and one that cannot be numbered is refused", "[stages]") {
    Scene scene = project_scene("furnace", 4097, 4097);
    RenderSettings s = cpu_settings(scene, Estimator::naive);
    s.max_depth = 20;
    const FilmMoments film = render_scene(scene, s, 1).film;
    // A white body in a white room: every pixel is 1, but where a ray grazes the body within rounding and meets its
    // back: one in a million at most.
    size_t wrong = 0;
    for (double v : film.sum) wrong += std::abs(v - 1) > 1e-5;
    CHECK(wrong <= film.sum.size() / 1000000);

    const Scene huge = project_scene("cornell", 65536, 65536);
    try {
        shape_wave(huge, 1, 2048, 1);
        FAIL("a film of 65536x65536 was accepted");
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::usage);
        CHECK(std::string(e.what()).find("65536x65536") != std::string::npos);
    }
}

TEST_CASE("G3: queues of any size hold what fits and count what does not", "[stages]") {
    for (uint32_t capacity : {0u, 1u, 31u, 32u, 33u, 1000u}) {
        INFO("capacity " << capacity);
        constexpr uint32_t kGuard = 16;
        std::vector<Lane> lanes(size_t(capacity) * LaneArray<PathHit>::kLanes + kGuard, Lane{{7, 7, 7, 7}});
        QueueCounter counter{};
        counter.capacity = capacity;
        const Queue<PathHit> queue = {{lanes.data(), capacity}, &counter};
        for (uint32_t i = 0; i < capacity + 5; ++i)
            queue.push(
                {{{float(i), 1, 2}, i, {3, 4, 5}, SubpathBits::make(i % 16384, i & 1, 1), {6, 7, 8}, float(i) / 2, {}},
                 0.25f,
                 0.5f,
                 i + 1,
                 0});
        CHECK(counter.size() == capacity);
        for (uint32_t i = 0; i < capacity; ++i) {
            const PathHit h = queue.load(i);
            CHECK(h.ray.origin.x == float(i));
            CHECK(path_of(h) == i);
            CHECK(h.ray.bits.depth() == i % 16384);
            CHECK(h.ray.sum_or_tmax == float(i) / 2);
            CHECK(h.prim == i + 1);
        }
        for (uint32_t g = 0; g < kGuard; ++g) CHECK(lanes[lanes.size() - 1 - g].word[0] == 7);
        counter.finish();
        CHECK(counter.count == 0);
        CHECK(counter.next == 0);
        CHECK(counter.peak == capacity + 5);
        CHECK(counter.overflow == 5);
        // A smaller filling keeps the peak; another loss adds up.
        if (capacity) queue.push({});
        counter.finish();
        CHECK(counter.peak == capacity + 5);
        CHECK(counter.overflow == 5);
        for (uint32_t i = 0; i < capacity + 2; ++i) queue.push({});
        counter.finish();
        CHECK(counter.overflow == 7);
    }
}
